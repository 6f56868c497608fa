"""MuJoCo's flex: linear tetrahedra, St. Venant-Kirchhoff or stable neo-Hookean, implicit steps."""
import mujoco

ALIKE = 2 / damping  # stiffness-proportional damping that is critical where that of mass is, s


def model(law, dt):
    numbers = lambda array: " ".join(map(repr, array.ravel().tolist()))
    text = f"""<mujoco><option gravity="0 0 {gravity}" timestep="{dt}"/><size memory="2G"/><worldbody>
    <flexcomp name="block" type="direct" dim="3" mass="{masses.sum()}" radius="1e-4"
     point="{numbers(X)}" element="{numbers(tets)}">
    <elasticity young="{young}" poisson="{poisson}" damping="{ALIKE}"/>
    <contact selfcollide="none" contype="0" conaffinity="0"/><pin id="{numbers(fixed)}"/>
    </flexcomp></worldbody></mujoco>"""
    spec = mujoco.MjSpec.from_string(text)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.flexes[0].elastic3d = law
    made = spec.compile()
    free = made.flex_vertbodyid > 0
    made.body_mass[made.flex_vertbodyid[free]] = masses[free]  # else every node has the same
    mujoco.mj_setConst(made, mujoco.MjData(made))
    return made


LAWS = {"St. Venant-Kirchhoff": 0, "stable neo-Hookean": 1}
for law, dt in [(law, dt) for law in LAWS for dt in (2e-3, 1e-2, 2.5e-2, 0.1)]:
    m = model(LAWS[law], dt)
    d = mujoco.MjData(m)
    run(law, dt, lambda: mujoco.mj_step(m, d), lambda: d.flexvert_xpos)
