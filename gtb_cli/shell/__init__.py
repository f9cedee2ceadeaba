"""What commands share: streams, messages, options, processes, manifests. No mathematics, no geometry."""
