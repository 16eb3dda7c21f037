"""Motion without crank angles: the ladder of the search for poses that have both rotation and position.

Data flow of a request::

    poses -> linear dyads (one SVD, a quartic) -> pairs of dyads as four-bars with crank angles -> those of the family, on
      one branch and in order -> joint refinement -> reached? otherwise dyads from starts all over the body
      -> their pairs, the best of them refined in rounds
"""
