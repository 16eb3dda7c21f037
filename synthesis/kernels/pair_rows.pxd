cimport cython
from synthesis.kernels.guide cimport Guide


@cython.final
cdef class PairRows:
    cdef Py_ssize_t samples
    cdef double[:, ::1] targets
    cdef bint has_timing
    cdef double transmission
    cdef bint ordered
    cdef double span_max
    cdef double arm_min
    cdef double stroke_max
    cdef double link_max
    cdef double link_min
    cdef double link_ratio
    cdef double coupler_radius
    cdef double cylinder_dead_length
    cdef double cylinder_extended_max
    cdef double crank
    cdef double coupler
    cdef double ground
    cdef double[:, ::1] pivots
    cdef double[:, ::1] pivot_boxes
    cdef double complex middle
    cdef double[::1] reaches
    cdef double[:, ::1] rail_boxes
    cdef double rail_reach
    cdef double[::1] envelope
    cdef double[:, ::1] keep_out
    cdef int size
    cdef Guide first_guide
    cdef Guide second_guide
    cdef bint is_hinge
    cdef bint is_slider
    cdef double branch
    cdef double direction
    cdef double sign
    cdef double start
    cdef int sweeps
    cdef double weight
    cdef double rotation
    cdef double complex position
    cdef double l11
    cdef double l21
    cdef double l22
    cdef double first_residual
    cdef double second_residual
    cdef double[:, ::1] pose_inverse
    cdef double drive_gap
    cdef bint is_open
    cdef double drive
    cdef double sine
    cdef double cosine
    cdef double complex gap
    cdef double[::1] rotation_slopes
    cdef double complex[::1] position_slopes
    cdef double[::1] row
    cdef double[::1] second_row
    cdef double[::1] drive_row
    cdef double complex[:, ::1] vectors
    cdef double[:, :, ::1] tracked
    cdef double[:, ::1] lengths
    cdef int[4] has_length
    cdef bint with_rows
    cdef bint is_valid
    cdef bint closed
    cdef double[:, ::1] poses
    cdef double cost
    cdef double worst
    cdef double merit
    cdef double violation_squares
    cdef double sine_sum
    cdef double drive_travel
    cdef double extension
    cdef int filled_rows
    cdef double[:, ::1] rows
    cdef load(self, double[::1] unknowns, double[::1] labels)
    cdef set_pose(self, double angle, double complex position)
    cdef factorise_pose_system(self, Py_ssize_t i, double angle, double complex position)
    cdef project_pose(self, Py_ssize_t i, int sweeps)
    cdef solve_driven_pose(self, Py_ssize_t i, int sweeps)
    cdef invert_pose_system(self, double target)
    cdef double pose_change(self, int k, double first, double second, double third)
    cdef update_drive(self)
    cdef update_transmission(self)
    cdef transmission_slopes(self, double[::1] out, double scale)
    cdef gap_slopes(self)
    cdef put_row(self, double[::1] row, double scale, double value)
    cdef fill_sample_rows(self, Py_ssize_t i)
    cdef fill_driven_rows(self, double v, double p, Py_ssize_t i)
    cdef bint register_limit(self, double value, double among, bint equal)
    cdef put_limit_row(self, double[::1] row, double sign, double value, bint equal)
    cdef chain_pose_slopes(self, double[::1] row)
    cdef double[::1] project_slopes(self, double complex to, int v)
    cdef put_slopes_of(self, int what)
    cdef inside_box(self, double complex point, int what, double[::1] box, double among)
    cdef outside_box(self, double complex point, int what, double[::1] box)
    cdef within_distance(self, double complex off, int what, double distance, double among)
    cdef sample_limits(self)
    cdef guide_limits(self, Guide guide, double many)
    cdef store_tracked(self, int which, Py_ssize_t i, double value)
    cdef track_drive(self, Py_ssize_t i)
    cdef track_travel(self, int which, Py_ssize_t i, Guide guide)
    cdef put_difference_row(self, int which, Py_ssize_t i, Py_ssize_t j, double sign, double value)
    cdef motion_limits(self)
    cdef double cylinder_reference(self)
    cdef cylinder_limits(self)
    cdef measure_distance(self, int which, double complex gap)
    cdef measure_links(self)
    cdef length_limit(self, int which, double sign, double value, bint equal)
    cdef link_limits(self)
    cdef ratio_limit(self, int j, int k)
    cdef point_limits(self, Guide guide)
    cdef bint evaluate(self, bint full, bint bounded)
