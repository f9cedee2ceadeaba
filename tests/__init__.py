"""The tests: folders and modules are those of `gtb_cli`; the modules beside this one hold what they share."""
