cimport cython


@cython.final
cdef class Guide:
    cdef int index
    cdef double complex point
    cdef double complex inward_normal
    cdef double offset
    cdef double unit
    cdef double curvature
    cdef double complex origin
    cdef bint is_straight
    cdef bint is_slot
    cdef double complex rotation
    cdef double complex frame
    cdef double complex rotated_point
    cdef double complex local_point
    cdef double complex foot_offset
    cdef double rise
    cdef double root
    cdef double distance
    cdef double complex normal
    cdef double complex by_rotation
    cdef double complex by_position
    cdef double rotation_slope
    cdef double complex position_slope
    cdef load(self, double[::1] unknowns, double[::1] labels, int index)
    cdef set_pose(self, double complex turned, double complex position)
    cdef put_point_slopes(self, double complex[::1] out, double complex moved)
    cdef distance_slopes(self, double[::1] out)
    cdef normal_slopes(self, double[::1] out, double sign)
    cdef double travel(self)
    cdef travel_slopes(self, double[::1] out)
    cdef double complex ground_point(self)
    cdef ground_point_slopes(self, double complex[::1] out)
    cdef local_slopes(self, double complex[::1] out)
    cdef double complex pivot(self)
    cdef pivot_slopes(self, double complex[::1] out)
