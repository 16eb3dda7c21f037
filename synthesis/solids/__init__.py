"""A linkage as solid parts: prisms in place, their mass, and the files of CAD programs, printers and simulators."""
