"""The memory that this process may use, by ``ulimit -v`` or --max-memory; too large meshes: `too_many_faces`."""

from gtb_cli.errors import GtbError

# Smallest limit: numpy, scipy and trimesh with the buffers of both BLAS libraries take 285 MB of addresses
LEAST_BYTES = 320 << 20
SCARCE_BYTES = 1 << 30  # below them, this process does all work itself

_allowed: int | None = None  # bytes that --max-memory allows this process and its children


def limit_of_addresses() -> int | None:
    """Return the bytes of addresses that this process may use, if they are limited."""
    try:
        import resource
    except ImportError:  # not on Windows
        return None
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return None if limit == resource.RLIM_INFINITY else limit


def is_scarce() -> bool:
    """Tell whether memory is so limited that a worker process might lack what it needs to send its result."""
    limit = limit_of_addresses()
    return limit is not None and limit < SCARCE_BYTES


def limit_to(size: int) -> None:
    """Let the system refuse this process, and all that it starts, more addresses than this many bytes."""
    global _allowed
    import resource

    _, most = resource.getrlimit(resource.RLIMIT_AS)
    limit = size if most == resource.RLIM_INFINITY else min(size, most)
    try:
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    except (OSError, ValueError) as error:
        raise GtbError(f"--max-memory: this system does not limit memory: {error}") from None
    _allowed = size


def divided_among(jobs: int) -> int:
    """Return how many of `jobs` processes there may be; under --max-memory, each gets a part of the memory."""
    if is_scarce():
        return 1
    if _allowed is None:
        return jobs
    import resource

    _, whole = resource.getrlimit(resource.RLIMIT_AS)
    jobs = max(1, min(jobs, whole // SCARCE_BYTES - 1))
    if jobs > 1:
        resource.setrlimit(resource.RLIMIT_AS, (whole // (jobs + 1), whole))
    return jobs


def shortage() -> str:
    """Return the message for what needs more memory than there is."""
    return "not enough memory for this" + (f" within --max-memory {size_text(_allowed)}" if _allowed else "")


def size_text(size: int) -> str:
    """Return a number of bytes as --max-memory takes it."""
    return f"{size / (1 << 20):.6g}M"


def prepare_for_limit() -> None:
    """Let BLAS take its memory first, as it ends the process or hangs without any; refuse a limit that is too low."""
    limit = limit_of_addresses()
    if limit is None:
        return
    if limit < LEAST_BYTES:
        at_least = f"gtb needs at least {LEAST_BYTES >> 20} MB"
        raise GtbError(f"not enough memory: the limit (ulimit -v) is {limit >> 20} MB, {at_least}")
    import numpy as np

    matrix = np.ones((200, 200))  # whose product needs the buffer of BLAS, which it then keeps
    np.matmul(matrix, matrix)
    if is_scarce():
        from scipy.linalg.blas import dgemm

        dgemm(1.0, matrix, matrix)
