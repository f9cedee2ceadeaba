"""Parts that commands share: streams, messages, options, manifests; no mathematics and no geometry."""
