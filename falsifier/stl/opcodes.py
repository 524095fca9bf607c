"""The steps of a compiled formula; ``compiler`` emits them, ``kernels`` executes them.

Each row of a program is ``(code, out, a, b, length, width)``: offsets into one flat buffer, the number of
samples to write and, for sliding windows, the number of samples in the window after its first. Numba's cache
does not notice changes in this file: after a change, touch ``kernels.py`` too.
"""

SCALE = 0  # out = p*a + q, with the two numbers of the row
FILL = 1  # out = q
ADD, SUBTRACT, MULTIPLY, DIVIDE, POWER, MINIMUM, MAXIMUM = 2, 3, 4, 5, 6, 7, 8
ABS, SQRT, EXP, LOG, SIN, COS = 9, 10, 11, 12, 13, 14
WINDOW_MINIMUM, WINDOW_MAXIMUM = 15, 16  # out[i] = minimum, maximum of a[i..i+width]
REST_MINIMUM, REST_MAXIMUM = 17, 18  # out[i] = minimum, maximum of a[i..end]
UNTIL = 19  # out[i] = max(b[i], min(a[i], out[i+1]))
CHECK = 20  # the evaluation stops unless a is finite; where it is 0, it becomes p
