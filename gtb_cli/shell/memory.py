"""The memory that this process may use, where the system limits it (``ulimit -v``)."""

from gtb_cli.errors import GtbError


def limit_of_addresses() -> int | None:
    """Return the bytes of addresses that this process may use, if they are limited."""
    try:
        import resource
    except ImportError:  # not on Windows
        return None
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return None if limit == resource.RLIM_INFINITY else limit


def is_scarce() -> bool:
    """Tell whether memory is limited so much that this process had better do all work itself, and first load scipy.

    A worker process that cannot allocate what it needs to send its result would be waited for in vain.
    """
    limit = limit_of_addresses()
    return limit is not None and limit < 1 << 30


def prepare_for_limit() -> None:
    """Let BLAS take its memory first: later, where there is none left, it ends the process itself or hangs.

    Raises a `GtbError` if the limit is so low that not even the libraries can be loaded.
    """
    # Smallest limit: numpy, scipy and trimesh with the buffers of both BLAS libraries take 285 MB of addresses
    least_bytes = 320 << 20
    limit = limit_of_addresses()
    if limit is None:
        return
    if limit < least_bytes:
        at_least = f"gtb needs at least {least_bytes >> 20} MB"
        raise GtbError(f"not enough memory: the limit (ulimit -v) is {limit >> 20} MB, {at_least}")
    import numpy as np

    matrix = np.ones((200, 200))  # whose product needs the buffer of BLAS, which it then keeps
    np.matmul(matrix, matrix)
    if is_scarce():
        from scipy.linalg.blas import dgemm

        dgemm(1.0, matrix, matrix)
