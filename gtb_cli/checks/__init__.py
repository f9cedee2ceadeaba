"""The paper's properties, measured on patches and models, with reports; bounding boxes."""
