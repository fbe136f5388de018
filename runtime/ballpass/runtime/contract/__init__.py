"""The contract between the two halves: what a generated folder holds and how to call it.

`derive` writes one `Manifest` beside the generated code; `runtime` reads it and needs nothing else from `derive`.
All numbers are SI.  Reading checks the schema and names what is wrong; writing is deterministic.

Every generated function of the model has the arguments ``t, x, u, p, c`` (those it lists in its signature):

=== ======================================================================================================
t   time since the reference time of the phases [s]
x   states: positions, then velocities, in the order of `Manifest.states`
u   inputs, constant between breakpoints, in the order of `Manifest.inputs`
p   parameters in the order of `Manifest.parameters`
c   derived constants in the order of `Manifest.constants`, from ``constants(p)``, evaluated once a run
=== ======================================================================================================
"""
