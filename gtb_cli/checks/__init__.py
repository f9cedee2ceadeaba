"""The paper's properties, measured on patches and models, with reports; areas, volumes and bounding boxes."""
