"""What commands share: options, streams, messages, manifests, servers; no mathematics and no geometry."""
