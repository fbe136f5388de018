"""Ball bearings: geometry, Hertz contact, equations of motion, laws."""
