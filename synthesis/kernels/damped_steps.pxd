cdef triangularise(double[:, ::1] m, int columns, int rows)
