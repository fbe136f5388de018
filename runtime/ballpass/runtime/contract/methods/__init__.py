"""Integration methods of the stepper, one file each: ``METHOD`` of a module is known everywhere (`method_registry`)."""
