"""Shows what a package's tests don't see: `python -m tests.mutation gcs_formation/control`.

A mutant is the package with one small fault: another comparison, sign or number, a condition turned round, a statement
left out. Each runs against the package's own tests in a process of its own; no file is changed. Where one lives, a test
is missing, or the fault changes nothing that anyone could see.
"""
