"""The chain over HTTP and on the command line: its slot on a crescent."""

from app.scenes.chain.slot import SLOT

QUERIES = (SLOT,)
