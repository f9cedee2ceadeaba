"""Solids for CAD files: what a surface must be, and the measures that the kernel's solid must have."""

from gtb_cli.errors import DomainError, RequirementError
from gtb_cli.formats.cad import Wall
from gtb_cli.meshes.measures import centre_of_mass, measure
from gtb_cli.models.model import Model
from gtb_cli.tessellation.recipe import Recipe
from gtb_cli.theory.patch import Patch


def wall_of(spec: Patch | Model, kind: str, recipe: Recipe) -> Wall | None:
    """Measure, by a mesh, the solid of a recipe's thickness, if any, that a CAD file is to hold.

    Raises `DomainError` if the surface is closed or has a crease, or the offset folds.
    """
    words = ("smooth:0.01deg", "solid")  # at creases the kernel leaves gaps, and calls the solid valid
    if recipe.thickness is None:
        return None
    if isinstance(spec, Model) and spec.joints.closed:
        raise DomainError(f"thickness: a closed surface is a solid in {kind.upper()} as it is: leave the thickness out")
    try:
        solid, _ = Recipe(thickness=recipe.thickness, weld=recipe.weld, require=words).mesh(spec)
    except RequirementError as error:
        raise DomainError(
            f"thickness: {kind.upper()} holds solids of smooth surfaces that do not fold, and this is "
            f"{error.args[0]}; 3MF, STL and OBJ hold the solid as a mesh"
        ) from None
    volume = measure(solid).volume
    assert volume is not None
    return Wall(recipe.thickness, volume, centre_of_mass(solid))
