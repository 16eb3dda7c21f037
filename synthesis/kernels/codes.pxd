# The numbers of `codes.py` as constants of C.

cdef enum:
    CIRCLE = 0
    RAIL = 1
    SLOT = 2
    GRASHOF = 0
    ANY = 1
    FULL_CRANK = 2
    SLIDER_CRANK = 3
    SWINGING_BLOCK = 4
    ANY_SLIDER_CRANK = 5
    ANY_SWINGING_BLOCK = 6
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
