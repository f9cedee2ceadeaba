"""The paper, in its order: domain, basis, moment map, patch, decompositions and limits. Knows no mesh."""
