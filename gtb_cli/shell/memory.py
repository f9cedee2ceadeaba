"""The memory that this process may use, where the system limits it (``ulimit -v``)."""

from __future__ import annotations

from gtb_cli.errors import GtbError


def prepare_for_limit() -> None:
    """Let BLAS take its memory first: later, where there is none left, it ends the process itself or hangs.

    Raises
    ------
    GtbError
        The limit is so low that not even the libraries can be loaded.
    """
    # Smallest limit: numpy, scipy and trimesh with the buffers of both BLAS libraries take 285 MB of addresses
    least_bytes = 320 << 20
    # Limit above which scipy, which takes long to load, is left to those that need it
    ample_bytes = 1 << 30
    buffered_size = 200  # rows of matrices whose product needs the buffer of BLAS, which it then keeps
    try:
        import resource
    except ImportError:  # not on Windows
        return
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return
    if limit < least_bytes:
        needed = f"gtb needs at least {least_bytes >> 20} MB"
        raise GtbError(f"not enough memory: the limit (ulimit -v) is {limit >> 20} MB, {needed}")
    import numpy as np

    matrix = np.ones((buffered_size, buffered_size))
    np.matmul(matrix, matrix)
    if limit < ample_bytes:
        from scipy.linalg.blas import dgemm

        dgemm(1.0, matrix, matrix)
