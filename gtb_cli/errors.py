"""The errors of this package: one root, and a leaf for each case that callers can handle."""


class GtbError(Exception):
    """Root of all errors raised on purpose; its text is one clear message for a person."""


class SpecError(GtbError, ValueError):
    """A spec file or one of its values is wrong; the message holds one line per error."""


class DomainError(GtbError, ValueError):
    """Knots without a proper convex hull, arrays of the wrong shape, or parameters outside the domain."""


class ExportError(GtbError, RuntimeError):
    """A mesh cannot be written in the requested format or to the requested place."""


class ToleranceError(GtbError, RuntimeError):
    """A requested accuracy was not reached within the given limits."""


class RequirementError(GtbError, RuntimeError):
    """A result is right, but lacks a required property."""
