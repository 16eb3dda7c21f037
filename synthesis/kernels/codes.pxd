# The numbers of `codes.py` as constants of C.

cdef enum:
    GRASHOF = 0
    ANY = 1
    USED = 0
    OVER_TURN = 1
    LENGTH = 2
    RATIO = 3
    RATIOS = 4
    FAMILY = 5
    AT = 6
    NEAR = 7
    INSIDE = 8
    OUTSIDE = 9
    ENVELOPE = 10
    PIVOT_A = 0
    PIVOT_B = 1
    BODY = 2
    BODY_FROM_ROCKER = 3
    BY_FIRST = 4
    BY_LAST = 5
    BY_PIVOT = 6
    BY_TURNED = 8
    BY_BODY = 9
    COLUMNS = 11
    GUIDE_UNKNOWNS = 5
    BY_START = 10
    BY_ROTATION = 11
    BY_X = 12
    BY_Y = 13
    PAIR_WIDTH = 14
    PAIR_VALUE = 11
