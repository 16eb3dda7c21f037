cimport cython


cdef double pair_difference(double a, double b, double c, double d)


@cython.final
cdef class Loop:
    cdef double[4] length
    cdef double x0
    cdef double y0
    cdef double branch
    cdef double complex e1
    cdef double complex e2
    cdef double[5] partials
    cdef double root
    cdef double sine_squared
    cdef double sine_cosine
    cdef double projection
    cdef set_lengths(self, double l1, double l2, double l3, double l4)
    cdef bint close_at(self, double theta1, bint slopes) noexcept
    cdef double coupler_angle(self, double theta1) noexcept


@cython.final
cdef class Shape:
    cdef int chart
    cdef int size
    cdef Loop loop
    cdef double[:, ::1] partials
    cdef evaluate(self, double q0, double q1, double q2, double q3, double side)
    cdef grashof(self, double q0, double x, double y, double z)
