"""One thread for BLAS, where nothing else was asked for; to be imported before NumPy.

The factorisations are thousands of small dense products. Two threads gain little on them, and wait for each
other on a machine that has something else to do: a pattern with corners on 30,000 vertices then took 60 s
where one thread takes 3.
"""

import os

ONE_THREAD = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMEXPR_NUM_THREADS",
    ),
    "1",
)

for _name, _count in ONE_THREAD.items():
    os.environ.setdefault(_name, _count)
