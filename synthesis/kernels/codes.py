"""Integer codes of charts, limits and columns in the arrays of the kernels. `codes.pxd` repeats them for C."""

# Charts: coordinates of shapes
GRASHOF = 0
ANY = 1

# Limits of a four-bar, with the numbers that follow the code in a row of the table
USED = 0  # cosine of the smallest transmission angle over the used interval
OVER_TURN = 1  # the same over a whole turn; 1 for every linkage, 0 only for linkages whose crank turns fully
LENGTH = 2  # link, sign, rest: sign times the length, plus the rest, is at least 0 (or equals 0)
RATIO = 3  # the shortest length times this number is at least every other length
RATIOS = 4  # the same for each pair of links, in logarithms
FAMILY = 5  # sign of the first two excesses (0: signs of any full crank)
AT = 6  # point, x, y: the point has this position
NEAR = 7  # point, x, y, distance
INSIDE = 8  # point, xmin, ymin, xmax, ymax
OUTSIDE = 9  # the same numbers; the point lies beyond the nearest side
ENVELOPE = 10  # xmin, ymin, xmax, ymax, traced positions, refinements: all joints over the used interval
COUNTS = (2, 2, 1, 4, 12, 3, 2, 1, 4, 1, 20)
"""Number of rows of each limit."""

# Points that limits refer to
PIVOT_A = 0
PIVOT_B = 1
BODY = 2  # z2, the body point seen from the crank pin
BODY_FROM_ROCKER = 3  # the body point seen from the coupler pin

# Columns of the derivatives of a limit, after the four lengths
BY_FIRST = 4  # first crank angle
BY_LAST = 5  # last crank angle
BY_PIVOT = 6  # pivot A (x, y)
BY_TURNED = 8  # angle of the ground link
BY_BODY = 9  # z2 (x, y)
COLUMNS = 11

# Unknowns of each guide of a pair: body point (x, y), direction and offset of the curve's normal, curvature
GUIDE_UNKNOWNS = 5
BY_START = 10  # drive at the first sample, if it is prescribed
# Columns of the derivatives with respect to the pose of a pair, after the unknowns
BY_ROTATION = 11
BY_X = 12
BY_Y = 13
PAIR_WIDTH = 14
PAIR_VALUE = 11  # column of the value, after the derivatives with respect to the unknowns
