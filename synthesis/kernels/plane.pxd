# The functions of `plane.py`, inline and without the products by zero of C's complex numbers.


cdef inline double complex vector(double x, double y) noexcept:
    cdef double complex z
    z.real = x
    z.imag = y
    return z


cdef inline double complex times(double factor, double complex z) noexcept:
    return vector(factor * z.real, factor * z.imag)


cdef inline double inner(double complex a, double complex b) noexcept:
    return a.real * b.real + a.imag * b.imag


cdef inline double cross(double complex a, double complex b) noexcept:
    return a.real * b.imag - a.imag * b.real


cdef inline double clip(double value, double bound) noexcept:
    return min(max(value, -bound), bound)


cdef inline double depth_inside(double complex point, int side, double edge) noexcept:
    cdef double value = (point.imag if side % 2 else point.real) - edge
    return value if side < 2 else -value
