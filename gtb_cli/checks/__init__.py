"""The paper's properties, measured on patches and models: findings and reports."""
