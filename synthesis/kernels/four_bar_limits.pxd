cimport cython
from synthesis.kernels.crank_loops cimport Loop



@cython.final
cdef class Limits:
    cdef double[:, ::1] table
    cdef int[::1] begins
    cdef int rows
    cdef int[::1] equal
    cdef bint posed
    cdef double[::1] values
    cdef double[:, ::1] slopes
    cdef Loop loop
    cdef double[3] excess
    cdef double first
    cdef double last
    cdef double complex pivot
    cdef double complex turned
    cdef double complex body
    cdef double complex[4] joint
    cdef double complex[:, ::1] joint_by
    cdef double[:, ::1] trace
    cdef at(self, double first, double last, double complex pivot, double complex turned, double complex body)
    cdef double transmission(self, int row, double least, double at, double sign)
    cdef used_transmission(self, int row, double least)
    cdef turn_transmission(self, int row, double least, bint every)
    cdef excesses(self)
    cdef of_length(self, int row, int link, double sign, double rest)
    cdef double perimeter(self)
    cdef ratio(self, int row, double most)
    cdef ratios(self, int row, double most)
    cdef family(self, int row, double sign)
    cdef fixed(self, int point)
    cdef place(self, int row, int kind, Py_ssize_t n)
    cdef beside(self, int row, int side, double edge, int k, double sign)
    cdef within(self, int row, Py_ssize_t n, int column)
    cdef bint joints(self, double share, bint slopes)
    cdef envelope(self, int row, Py_ssize_t n)
    cdef double farthest(self, int k, int side, int traced, int refinements)
    cdef double depth_at(self, double share, int k, int side)
