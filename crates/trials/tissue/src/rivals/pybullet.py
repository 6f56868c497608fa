"""PyBullet's deformable world: linear tetrahedra, neo-Hookean (Smith et al. 2018), implicit damping.

Every node has the same mass; only damping proportional to stiffness is offered.
"""
import pybullet

# The law's constants with these moduli at small strain.
mu, lame = 4 / 3 * shear, bulk + shear / 6


def block(dt, rate):
    pybullet.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD)
    pybullet.setGravity(0, 0, gravity)
    pybullet.setPhysicsEngineParameter(fixedTimeStep=dt, numSubSteps=1)
    body = pybullet.loadSoftBody(
        "block.vtk", simFileName="block.vtk", mass=density * volumes.sum(), useNeoHookean=1,
        NeoHookeanMu=mu, NeoHookeanLambda=lame, NeoHookeanDamping=rate, collisionMargin=1e-5, useSelfCollision=0)
    for node in fixed.tolist():
        pybullet.createSoftBodyAnchor(body, node, -1, -1)
    return body


def positions(body):
    return np.array(pybullet.getMeshData(body, -1, flags=pybullet.MESH_DATA_SIMULATION_MESH)[1])


with open("block.vtk", "w") as file:
    file.write(f"# vtk DataFile Version 2.0\nblock\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {len(X)} float\n")
    file.writelines(f"{x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in X)
    file.write(f"CELLS {len(tets)} {5 * len(tets)}\n")
    file.writelines(f"4 {a} {b} {c} {d}\n" for a, b, c, d in tets)
    file.write(f"CELL_TYPES {len(tets)}\n" + "10\n" * len(tets))
pybullet.connect(pybullet.DIRECT)
for rate, dt in [(rate, dt) for rate in (0.0, 0.02, 0.03) for dt in (1e-3, 2e-3, 5e-3, 1e-2)]:
    body = block(dt, rate)
    run(f"damping {rate}", dt, pybullet.stepSimulation, lambda: positions(body))
