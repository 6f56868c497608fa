"""Newton on the CPU: linear tetrahedra, stable neo-Hookean; explicit steps or vertex block descent, f32."""
import newton
import warp

warp.config.quiet = True
warp.set_device("cpu")


def block(mu, lame):
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, gravity))
    builder.add_soft_mesh(
        pos=warp.vec3(0.0, 0.0, 0.0), rot=warp.quat_identity(), scale=1.0, vel=warp.vec3(0.0, 0.0, 0.0),
        vertices=[warp.vec3(*x) for x in X.tolist()], indices=tets.ravel().tolist(), density=density,
        k_mu=mu, k_lambda=lame, k_damp=0.0, add_surface_mesh_edges=False, particle_radius=1e-4)
    for node in range(len(X)):
        builder.particle_mass[node] = masses[node]
    for node in fixed.tolist():
        builder.particle_mass[node] = 0.0
    builder.color()
    return builder.finalize()


def simulate(setting, model, solver, dt):
    states, control = [model.state(), model.state()], model.control()

    def advance():
        now, after = states
        now.clear_forces()
        solver.step(now, after, control, None, dt)
        velocities = after.particle_qd.numpy()  # a view of the solver's memory
        velocities *= np.exp(-damping * dt)  # mass-proportional, which Newton does not offer
        states.reverse()

    advance()  # compiles the kernels
    for state in states:
        state.assign(model.state())
    run(setting, dt, advance, lambda: states[0].particle_q.numpy())


lame = bulk - 2 / 3 * shear
# The explicit solver takes the constants of Smith et al. 2018 as they are, the other converts.
explicit, implicit = block(4 / 3 * shear, lame + 5 / 6 * shear), block(shear, lame)
for dt in (2e-3, 1e-3, 5e-4):
    simulate("semi-implicit", explicit, newton.solvers.SolverSemiImplicit(explicit), dt)
for iterations, dt in [(n, dt) for n in (10, 30, 100) for dt in (5e-3, 2.5e-2)]:
    solver = newton.solvers.SolverVBD(implicit, iterations=iterations)
    simulate(f"vertex block descent, {iterations} iterations", implicit, solver, dt)
