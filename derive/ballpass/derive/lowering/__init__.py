"""From SymPy to CasADi: functions, kernels, derivatives."""
