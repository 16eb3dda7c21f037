"""Plane vectors as complex numbers, for kernels that run uncompiled. `plane.pxd` repeats them as inline functions of C."""


def vector(x, y):
    """Return x + i y."""
    return x + 1j * y


def times(factor, z):
    """Return the product of a real and a complex number."""
    return factor * z


def inner(a, b):
    """Return the inner product, the real part of conj(a) b."""
    return a.real * b.real + a.imag * b.imag


def cross(a, b):
    """Return the outer product, the imaginary part of conj(a) b."""
    return a.real * b.imag - a.imag * b.real


def clip(value, bound):
    """Clip a value to the interval from -bound to bound."""
    return min(max(value, -bound), bound)


def depth_inside(point, side, edge):
    """Return the distance of a point from a side of a box, positive inside: 0 left, 1 lower, 2 right, 3 upper."""
    value = (point.imag if side % 2 else point.real) - edge
    return value if side < 2 else -value
