"""The parts that commands share: streams, messages, options, processes, manifests; no mathematics and no geometry."""
