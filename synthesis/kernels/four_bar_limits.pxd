cimport cython
from synthesis.kernels.crank_loops cimport Loop



@cython.final
cdef class Limits:
    cdef double[:, ::1] table
    cdef int[::1] first_rows
    cdef int rows
    cdef int[::1] equations
    cdef bint has_pose
    cdef double[::1] values
    cdef double[:, ::1] slopes
    cdef Loop loop
    cdef double[3] excess
    cdef double first_angle
    cdef double last_angle
    cdef double complex pivot
    cdef double complex ground_direction
    cdef double complex body_arm
    cdef double complex[4] joints
    cdef double complex[:, ::1] joint_slopes
    cdef double[:, ::1] trace
    cdef evaluate(self, double first, double last, double complex pivot, double complex turned, double complex body)
    cdef double transmission_row(self, int row, double cosine_max, double at, double sign)
    cdef used_transmission_rows(self, int row, double cosine_max)
    cdef turn_transmission_rows(self, int row, double cosine_max, bint always)
    cdef update_excesses(self)
    cdef length_row(self, int row, int link, double sign, double constant)
    cdef double perimeter(self)
    cdef ratio_rows(self, int row, double ratio_max)
    cdef log_ratio_rows(self, int row, double ratio_max)
    cdef family_rows(self, int row, double sign)
    cdef locate_fixed_point(self, int point)
    cdef point_rows(self, int row, int kind, Py_ssize_t n)
    cdef side_row(self, int row, int side, double edge, int k, double sign)
    cdef box_rows(self, int row, Py_ssize_t n, int column)
    cdef bint locate_joints(self, double share, bint slopes)
    cdef envelope_rows(self, int row, Py_ssize_t n)
    cdef double find_farthest(self, int k, int side, int traced, int refinements)
    cdef double depth_of_joint(self, double share, int k, int side)
