"""Design of drives: rotary drives, actuators, motors with a rod, and springs.

``design`` is the pipeline: `question` checks the request, `operation` prepares the linkage over the interval that is used,
one module for each kind of drive searches, and `records` holds the reply.
"""
