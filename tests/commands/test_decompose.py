"""`gtb decompose --all`: each decomposition has a number, to which a degeneration leads."""

import json

from tests.shell import gtb


def test_a_degeneration_leads_to_a_decomposition_by_its_lifting(tmp_path):
    spec = tmp_path / "hexagon.json"
    corners = [[2, 0], [3, 0], [4, 2], [3, 4], [1, 5], [0, 2]]
    spec.write_text(json.dumps({"knots": corners, "control_points": corners, "weights": [1] * 6}))
    found = json.loads(gtb("decompose", spec, "--all", "--json", status=0).out)["decompositions"]
    assert [row["cells"] for row in found] == sorted(row["cells"] for row in found)
    for row in found[::7]:
        lifting = ",".join(map(repr, row["lifting"]))
        assert json.loads(gtb("decompose", spec, "--json", f"--lifting={lifting}").out)["cells"] == row["cells"]
    lifting = "--lifting=" + ",".join(map(repr, found[40]["lifting"]))
    limit = gtb("degenerate", spec, lifting, "-x", "inf", "--emit-spec", status=0).text
    assert limit.count("[[patches]]") == len(found[40]["cells"])
