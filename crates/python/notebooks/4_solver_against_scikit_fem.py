# %% [markdown]
# # A solver against scikit-fem
# The same mesh, material and load in two programs that share no line of code: TLED settles to
# equilibrium, scikit-fem solves the linear system. At small strain both must agree, node by node;
# at large strain the linear system is wrong, and the notebook shows from where.

# %%
import numpy as np
import skfem
from matplotlib.figure import Figure
from skfem.helpers import ddot, eye, sym_grad, trace
from skfem.models.elasticity import lame_parameters

import trepan

YOUNG_MPA, POISSON, DENSITY = 0.003, 0.3, 1e-3
mesh = trepan.split_box((8, 8, 8), (40.0, 40.0, 40.0))
fixed = np.flatnonzero(mesh.positions[:, 2] < 1e-3)
material = trepan.Material.neo_hookean(YOUNG_MPA, POISSON, DENSITY)


def by_tled(gravity: float) -> np.ndarray:
    """Displacement of every node under its own weight, mm, (n, 3)."""
    solver = trepan.Tled(mesh, fixed, material)
    converged, left_mm, _ = solver.settle(trepan.Loads(gravity=(0, 0, -gravity)), tolerance_mm=1e-5)
    assert converged, f"{left_mm} mm are left"
    return solver.positions().astype(np.float64) - mesh.positions


def by_scikit_fem(gravity: float) -> np.ndarray:
    """The same by linear elasticity on the same tetrahedra."""
    points, corners = mesh.positions.T.astype(np.float64), mesh.tets.T.astype(np.int64)
    tets = skfem.MeshTet(np.ascontiguousarray(points), np.ascontiguousarray(corners))
    basis = skfem.Basis(tets, skfem.ElementVector(skfem.ElementTetP1()))
    first, shear = lame_parameters(YOUNG_MPA, POISSON)

    @skfem.BilinearForm
    def stiffness(u, v, _):  # type: ignore[no-untyped-def]
        strain = sym_grad(u)
        return ddot(first * eye(trace(strain), 3) + 2 * shear * strain, sym_grad(v))

    @skfem.LinearForm
    def weight(v, _):  # type: ignore[no-untyped-def]
        return -DENSITY * gravity * v[2]

    held = basis.nodal_dofs[:, fixed].ravel()
    solution = skfem.solve(*skfem.condense(stiffness.assemble(basis), weight.assemble(basis), D=held))
    return solution[basis.nodal_dofs].T


# %%
shares = np.array([0.001, 0.01, 0.05, 0.2, 0.5, 1.0])
linear = by_scikit_fem(9.81e-3)
errors = []
for share in shares:
    tled = by_tled(share * 9.81e-3)
    error = np.linalg.norm(tled - share * linear, axis=1).max() / np.linalg.norm(share * linear, axis=1).max()
    errors.append(100 * error)
    sag = np.abs(tled[:, 2]).max()
    print(f"{share:5.3f} of Earth's gravity: sag {sag:.4f} mm, largest difference {errors[-1]:.2f} %")
assert errors[1] < 1.0, "TLED and scikit-fem differ at small strain"

# %%
figure = Figure(figsize=(6, 3.6), layout="constrained")
axes = figure.subplots()
axes.loglog(shares, errors, "o-")
axes.set(xlabel="gravity, of Earth's", ylabel="largest difference, %", title="where linear elasticity ends")
figure
