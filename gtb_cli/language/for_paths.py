"""Public functions of the wings below, made to take the path of a spec in place of a patch or model."""

from gtb_cli.language.spec_paths import SpecPath, loaded, of_patch
from gtb_cli.models.joints import Joints
from gtb_cli.models.model import Model
from gtb_cli.theory import corners, quadrature as integrals
from gtb_cli.theory.patch import Patch

boundary = of_patch(Patch.boundary)
corner_limits = of_patch(corners.corner_limits)
quadrature = of_patch(integrals.quadrature)


def joints(model: Model | SpecPath) -> Joints:
    """Return `Model.joints`: which edges of a model's patches carry the same curve, and which are open.

    Raises
    ------
    DomainError
        The argument is neither a model nor the path of one's spec.
    """
    found: Model = loaded(model, Model)
    return found.joints
