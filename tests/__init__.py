"""The tests, one module for each room; `patches` and `meshes` hold what they share."""
