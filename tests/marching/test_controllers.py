"""Controllers: against closed forms of sampled loops, in several kinds of body, and refused."""

import math

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart
from scipy.linalg import expm, solve_discrete_are

import impactfem
from impactfem import Scene, SceneError
from impactfem.runs.feedback import held_flow, loop_radius

ARM = {"kind": "rigid", "name": "arm", "model": "2d", "mass": 1.0, "inertia": 1.0,
       "shape": {"kind": "block", "size": [0.2, 0.1], "corner": [-0.1, -0.05]}}  # fmt: skip
KNEE = {"kind": "revolute", "name": "knee", "between": ["ground", "arm"], "point": [0.0, 0.0]}
POINT = {"kind": "point", "name": "m", "mass": 2.0, "position": [0.0], "force": ["0"]}
WALL = {"kind": "half_space", "name": "wall", "point": [9.0], "normal": [-1.0]}


def turning(duration=2.0, *, solve=None, **control):
    """A body of inertia 1 about a hinge."""
    own = {"name": "hold", "kind": "pd", "acts": "joint.knee.motor", "of": "joint.knee.q"}
    return Scene.from_dict({
        "title": "turning", "duration": duration, "gravity": [0.0, -9.81], "body": [ARM],
        "joint": [KNEE], "controller": [own | control],
        "solve": {"estimate": False} | (solve or {}), "output": {"fields": []},
    })  # fmt: skip


def sliding(duration=2.0, bodies=(), **control):
    """A mass of 2 kg along a line, about which a controller acts."""
    own = {"name": "hold", "kind": "pd", "acts": "body.m.force.x", "of": "m.x"}
    given = {name: value for name, value in (own | control).items() if value is not None}
    return Scene.from_dict({
        "title": "sliding", "duration": duration, "body": [POINT, *bodies], "obstacle": [WALL],
        "controller": [given], "solve": {"estimate": False}, "output": {"fields": []},
    })  # fmt: skip


def steps_of(flow, gains, start, count):
    """States of x -> A x - B K x, (count + 1, n)."""
    a, b = flow
    found = [np.array(start, dtype=float)]
    for _ in range(count):
        found.append(a @ found[-1] - b * (gains @ found[-1]))
    return np.array(found)


def test_samples_are_those_of_the_discrete_loop():
    """Held forces move a mass exactly; so does the march."""
    h, kp, kd = 0.01, 200.0, 40.0
    flow = held_flow([[0.0, 1.0], [0.0, 0.0]], [0.0, 0.5], h)
    result = impactfem.solve(sliding(0.5, target=1.0, kp=kp, kd=kd, sample=h))
    x = result.history["m.x"].values
    every = (len(x) - 1) // 50
    assert every * 50 == len(x) - 1  # steps end with samples
    states = steps_of(flow, np.array([kp, kd]), [-1.0, 0.0], 50)
    np.testing.assert_allclose(x[::every] - 1.0, states[:, 0], atol=1e-12)
    u = result.history["hold.u"].values
    np.testing.assert_allclose(u[1::every], -states[:-1] @ [kp, kd], atol=1e-10)
    told = result.summary["controllers"]["hold"]
    assert told["inertia"] == pytest.approx(2.0, rel=1e-9)
    exact = np.abs(np.linalg.eigvals(flow[0] - np.outer(flow[1], [kp, kd]))).max()
    assert told["spectral_radius"] == pytest.approx(exact, rel=1e-9)
    # What the controller does becomes energy of motion.
    kinetic = result.history["kinetic_energy"].values
    assert told["work"] == pytest.approx(kinetic[-1], abs=1e-12 * kinetic.max())
    turned = impactfem.solve(turning(0.5, target=1.0, kp=0.5 * kp, kd=0.5 * kd, sample=h)).history
    np.testing.assert_allclose(turned["knee.q"].values[-1], x[-1], atol=1e-6)  # of its steps


def test_part_of_the_steps_is_that_formula():
    """Without a clock a PD is the formula of its motor, also where impacts are located."""
    one = impactfem.solve(turning(target="sin(t)", kp=30.0, kd=4.0, solve={"dt": 5e-3}))
    text = "30*(sin(t) - q) + 4*(0 - v)"
    data = turning(kp=1.0, solve={"dt": 5e-3}).to_dict()
    data.pop("controller")
    data["joint"][0]["motor"] = text
    other = impactfem.solve(Scene.from_dict(data))
    np.testing.assert_array_equal(one.history["knee.q"], other.history["knee.q"])
    found = impactfem.solve(sliding(target=1.0, kp=200.0, kd=12.0))
    assert found.summary["method"] == "event_driven"
    t, damping = found.history["time"].values, 3.0  # x'' + 6 x' + 100 x = 100
    w = math.sqrt(100.0 - damping**2)
    exact = 1.0 - np.exp(-damping * t) * (np.cos(w * t) + damping / w * np.sin(w * t))
    np.testing.assert_allclose(found.history["m.x"], exact, atol=1e-10)
    limited = impactfem.solve(sliding(target=1.0, kp=200.0, kd=12.0, limits=[-20.0, 20.0]))
    told = limited.summary["controllers"]["hold"]
    assert told["largest"] == 20.0
    assert 0.05 < told["saturated"] < 0.95


def test_a_motor_at_its_target_settles():
    """Parts of the formula cancel there, and leave but their rounding."""
    result = impactfem.solve(turning(6.0, target=1.0, kp=100.0, kd=20.0))
    assert result.summary["status"] == "completed"
    assert result.history["knee.q"].values[-1] == pytest.approx(1.0, abs=1e-12)


def test_droop_and_integral():
    """PD droops by m g / kp under gravity; the integral takes that away."""
    weight = 2.0 * 9.81
    data = sliding(8.0, target=0.0, kp=400.0, kd=80.0, sample=0.01).to_dict()
    data["gravity"] = [-9.81]
    droop = impactfem.solve(Scene.from_dict(data)).history["m.x"].values[-1]
    assert droop == pytest.approx(-weight / 400.0, rel=1e-9)
    data["controller"][0] |= {"kind": "pid", "ki": 400.0}
    rest = impactfem.solve(Scene.from_dict(data)).history["m.x"].values[-1]
    assert abs(rest) < 1e-4 * weight / 400.0


def test_samples_shorter_than_a_step_are_steps():
    """Once a step is measured: the integral, the inertia and the radius are those of that."""
    found = []
    for sample in (1e-3, 1e-2):
        data = sliding(0.5, target=1.0, kind="pid", kp=40.0, kd=8.0, ki=60.0, sample=sample)
        data = data.to_dict()
        data["solve"]["dt"] = 1e-2
        found.append(impactfem.solve(Scene.from_dict(data)))
    one, other = (each.summary["controllers"]["hold"] for each in found)
    assert one == other
    assert one["inertia"] == pytest.approx(2.0, rel=1e-9)
    assert one["sample"] == 1e-2
    np.testing.assert_array_equal(*(each.history["m.x"].values for each in found))
    told = [each["text"] for each in found[0].summary["verdict"]["findings"]]
    assert any("shorter than a step" in text for text in told)


def test_a_body_without_a_force_gets_one():
    """As motors and tractions that a scene leaves out do."""
    data = sliding(0.1, target=1.0, kp=200.0, kd=12.0).to_dict()
    data["body"][0].pop("force", None)
    Scene.from_dict(data)
    box = {"kind": "rigid", "name": "box", "model": "3d", "mass": 1.0,
           "shape": {"kind": "block", "size": [0.2, 0.1, 0.1], "corner": [0, 0, 0]}}  # fmt: skip
    control = {"name": "hold", "kind": "p", "kp": 1.0, "sample": 0.01}
    for acts, of, key in (("force.z", "box.z", "force"), ("moment.y", "box.wy", "moment")):
        scene = Scene.from_dict({
            "title": "box", "duration": 0.1, "body": [box],
            "controller": [control | {"acts": f"body.box.{acts}", "of": of}],
        })  # fmt: skip
        assert len(getattr(scene.bodies[0], key)) == 3
    solid = {"kind": "solid", "name": "box", "density": 1.0, "youngs_modulus": 1.0,
             "shape": {"kind": "disc", "radius": 1.0, "center": [0, 0]}}  # fmt: skip
    with pytest.raises(SceneError, match=r"controller\[0\].acts"):
        Scene.from_dict({
            "title": "box", "duration": 0.1, "body": [solid],
            "controller": [control | {"acts": "body.box.force.y", "of": "box.y"}],
        })  # fmt: skip


def test_the_integral_stands_at_limits():
    """A far target: without anti-windup the integral carries it far beyond."""
    over = []
    for stands in (True, False):
        scene = sliding(12.0, kind="pid", target=5.0, kp=20.0, kd=20.0, ki=10.0, sample=0.01,
                        limits=[-4.0, 4.0], anti_windup=stands)  # fmt: skip
        over.append(impactfem.solve(scene).history["m.x"].values.max() - 5.0)
    assert over[0] < 0.5 * over[1]


@pytest.mark.parametrize(
    ("kp", "kd", "h", "radius"),
    [(1e4, 0.0, 0.01, 0.7071068), (1e6, 10.0, 0.01, 0.0994545), (1.0, 10.0, 0.1, 0.98999)],
)
def test_radius_of_an_implicit_pd(kp, kd, h, radius):
    """With x+ = x + h v+ it is backward Euler of x'' = -kp x - kd x'."""
    shared = 1.0 + h * kd + h**2 * kp
    gains = np.array([kp, h * kp + kd]) / shared
    a, b = np.array([[1.0, h], [0.0, 1.0]]), np.array([h**2, h])
    assert loop_radius(a, b, gains) == pytest.approx(radius, rel=1e-5)
    if kd**2 <= 4.0 * kp:
        assert loop_radius(a, b, gains) == pytest.approx(1.0 / math.sqrt(shared), rel=1e-9)


def test_an_unstable_loop_is_told_and_an_implicit_one_stands_it():
    stiff = {"target": 0.1, "kp": 1e4, "kd": 0.0, "sample": 0.01}
    result = impactfem.solve(turning(0.3, **stiff))
    assert result.summary["controllers"]["hold"]["spectral_radius"] == pytest.approx(
        math.sqrt(1.5), rel=1e-6
    )
    found = {f["code"]: f for f in result.summary["verdict"]["findings"]}
    assert found["controller"]["severity"] == "warning"
    assert "errors grow" in found["controller"]["text"]
    q = impactfem.solve(turning(1.0, **stiff, kind="implicit_pd")).history["knee.q"].values
    assert abs(q[-1] - 0.1) < 1e-6
    assert np.abs(q - 0.1).max() < 0.1 + 1e-12


@pytest.mark.parametrize("lag", [0, 1, 3])
def test_delays_count_whole_samples(lag):
    h, kp, kd = 0.02, 20.0, 8.0
    result = impactfem.solve(sliding(1.0, target=1.0, kp=kp, kd=kd, sample=h, delay=lag * h))
    flow = held_flow([[0.0, 1.0], [0.0, 0.0]], [0.0, 0.5], h)
    x, waiting, found = np.array([-1.0, 0.0]), [0.0] * lag, []
    for _ in range(50):
        waiting.append(-np.array([kp, kd]) @ x)
        x = flow[0] @ x + flow[1] * waiting.pop(0)
        found.append(x[0])
    every = (len(result.history["m.x"]) - 1) // 50
    np.testing.assert_allclose(result.history["m.x"].values[every::every] - 1.0, found, atol=1e-12)
    # The radius is the rate at which the loop dies out in the end.
    told = result.summary["controllers"]["hold"]["spectral_radius"]
    assert told == pytest.approx(loop_radius(*flow, np.array([kp, kd]), lag=lag), rel=1e-9)


def test_bang_bang_is_of_least_time():
    """1 m with |u| <= m: T = 2 s, the switch at 1 s, to some samples; then it stays."""
    h = 1e-3
    scene = sliding(2.5, kind="bang_bang", target=1.0, limits=[-2.0, 2.0], sample=h)
    history = impactfem.solve(scene).history
    t, x, u = (history[name].values for name in ("time", "m.x", "hold.u"))
    assert t[np.argmax(u < 0.0)] == pytest.approx(1.0, abs=2.0 * h)
    late = t > 2.0 + 10.0 * h
    assert np.abs(x[late] - 1.0).max() < h**2
    assert np.abs(history["m.vx"].values[late]).max() < 1e-9


def test_a_switching_curve_may_change_in_time():
    scene = sliding(0.1, kind="bang_bang", limits=[-2.0, 3.0], sample=0.01,
                    curve="where(t < 0.045, -1, 1)")  # fmt: skip
    history = impactfem.solve(scene).history
    t, u = history["time"].values[1:], history["hold.u"].values[1:]
    np.testing.assert_array_equal(u, np.where(t < 0.05 + 1e-9, 3.0, -2.0))


def test_gains_of_a_quadratic_cost_are_those_of_riccati():
    """Of held forces, with the integral of the cost; the cost from there on is x P x."""
    h, q, r = 0.1, np.diag([3.0, 1.0]), 0.5
    model = {"state_matrix": [[0.0, 1.0], [4.0, 0.0]], "input_matrix": [0.0, 0.5]}
    scene = sliding(
        3.0, of=None, kind="lqr", columns=["m.x", "m.vx"], model=model, weights=[3.0, 1.0],
        effort=r, sample=h,
    )  # fmt: skip
    gains = scene.controllers[0].gains
    # Cost and flow of a sample, by many small ones.
    count = 2000
    a, b = held_flow(model["state_matrix"], model["input_matrix"], h / count)
    whole = np.block([[a, b[:, None]], [np.zeros((1, 2)), np.ones((1, 1))]])
    flow, cost, weight = np.eye(3), np.zeros((3, 3)), np.diag([3.0, 1.0, r])
    half = expm(0.5 * h / count * np.block([[np.array(model["state_matrix"]), b[:, None] * 0],
                                            [np.zeros((1, 3))]]))  # fmt: skip
    half[:2, 2] = held_flow(model["state_matrix"], model["input_matrix"], 0.5 * h / count)[1]
    for _ in range(count):  # Simpson's rule
        ends = [flow, half @ flow, whole @ flow]
        parts = [m.T @ weight @ m for m in ends]
        cost += h / count / 6.0 * (parts[0] + 4.0 * parts[1] + parts[2])
        flow = whole @ flow
    q, s, r = cost[:2, :2], cost[:2, 2:], cost[2:, 2:]
    p = solve_discrete_are(flow[:2, :2], flow[:2, 2:], q, r, s=s)
    b = flow[:2, 2:]
    exact = np.linalg.solve(r + b.T @ p @ b, b.T @ p @ flow[:2, :2] + s.T)[0]
    np.testing.assert_allclose(gains, exact, rtol=1e-9)
    told = impactfem.solve(scene).summary["controllers"]["hold"]
    closed = np.abs(np.linalg.eigvals(flow[:2, :2] - b @ exact[None])).max()
    assert told["spectral_radius"] == pytest.approx(closed, rel=1e-9)
    model = {"state_matrix": [[0.0, 1.0], [0.0, 0.0]], "input_matrix": [0.0, 1.0]}
    continuous = sliding(of=None, kind="lqr", columns=["m.x", "m.vx"], model=model)
    np.testing.assert_allclose(continuous.controllers[0].gains, [1.0, math.sqrt(3.0)], rtol=1e-12)


def test_a_solid_is_driven_by_what_a_probe_sees():
    """A bar under the traction kp (target - u): its tip comes to rest at kp target / (kp + E)."""
    scene = Scene.from_dict({
        "title": "bar", "duration": 40.0,
        "body": [{"kind": "solid", "name": "b", "model": "plane_strain", "mesh_size": 0.25,
                  "shape": {"kind": "block", "size": [0.25, 1.0], "corner": [0.0, 0.0]},
                  "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": 0.0,
                  "rayleigh_mass": 1.0,
                  "supports": [{"surface": "bottom", "kind": "fixed"}],
                  "tractions": [{"surface": "top", "value": ["0", "0"]}]}],
        "obstacle": [{"kind": "half_space", "name": "floor", "point": [0, -1], "normal": [0, 1]}],
        "probe": [{"name": "tip", "body": "b", "point": [0.125, 1.0]}],
        "controller": [{"name": "c", "kind": "pd", "acts": "body.b.tractions.0.value.y",
                        "of": "tip.uy", "target": 0.01, "kp": 1.0, "kd": 0.5, "sample": 0.1}],
        "solve": {"estimate": False, "method": "massless"}, "output": {"fields": []},
    })  # fmt: skip
    result = impactfem.solve(scene)
    assert result.history["tip.uy"].values[-1] == pytest.approx(0.005, rel=1e-5)
    assert result.summary["controllers"]["c"]["work"] is None  # a traction has no one coordinate


def both():
    """Two controllers with clocks, memory, delay and noise."""
    hold = turning(
        0.1, kind="pid", target="0.5*sin(3*t)", kp=40.0, kd=6.0, ki=30.0, limits=[-12.0, 12.0],
        sample=0.004, delay=0.008, noise={"sigma": 1e-3, "seed": 1}, solve={"dt": 2e-4},
    ).to_dict()  # fmt: skip
    point = POINT | {"position": [3.0, 3.0], "force": ["0", "0"]}
    lift = {"name": "lift", "kind": "pd", "acts": "body.m.force.y", "of": "body.m.y",
            "target": 3.0, "kp": 50.0, "kd": 5.0, "sample": 0.004}  # fmt: skip
    return Scene.from_dict(hold | {
        "body": [*hold["body"], point], "controller": [*hold["controller"], lift],
        "obstacle": [{"kind": "half_space", "name": "floor", "point": [0, -1], "normal": [0, 1]}],
        "output": {"fields": [], "checkpoint": 8},
    })  # fmt: skip


def test_restart_and_states(tmp_path, monkeypatch):
    scene = both()
    check_restart(scene, 101, tmp_path, monkeypatch)
    sim = impactfem.Simulation(scene)
    for _ in range(17):
        sim.step()
    kept = sim.state
    after = [sim.step().columns["knee.q"] for _ in range(5)]
    sim.restore(kept)
    assert [sim.step().columns["knee.q"] for _ in range(5)] == after
    while not sim.done:
        sim.step()
    whole, stepped = impactfem.solve(scene), sim.result()
    for name in ("knee.q", "m.y", "hold.u", "lift.u"):
        np.testing.assert_array_equal(stepped.history[name], whole.history[name])
    assert stepped.summary["controllers"] == whole.summary["controllers"]
    again = Scene.from_dict(scene.to_dict())
    assert again.to_dict() == scene.to_dict()
    assert [joint.motor.text for joint in again.joints] == ["hold"]


def test_outputs_from_python_are_those_of_the_same_law():
    """A law in Python, step by step, against the sampled one."""
    gains = {"kp": 200.0, "kd": 40.0}
    one = sliding(0.2, target=1.0, **gains, kind="pd", noise={"sigma": 0.0})
    other = sliding(0.2, of=None, kind="external", limits=[-500.0, 500.0])
    whole = impactfem.solve(one.with_settings({"solve.dt": 1e-3}))
    sim = impactfem.Simulation(other.with_settings({"solve.dt": 1e-3}))
    while not sim.done:
        now = sim.columns
        sim.step(outputs={"hold": 200.0 * (1.0 - now["m.x"]) - 40.0 * now["m.vx"]})
    found = sim.result()
    np.testing.assert_allclose(found.history["m.x"], whole.history["m.x"], atol=1e-13)
    np.testing.assert_allclose(found.history["hold.u"], whole.history["hold.u"], atol=1e-10)
    told = found.summary["controllers"]["hold"]
    assert told["work"] == pytest.approx(whole.summary["controllers"]["hold"]["work"], rel=1e-9)
    sim = impactfem.Simulation(sliding(0.2, of=None, kind="external"))
    for given, said in (({"m": 1.0}, "no external controller"), ({"hold": np.nan}, "no finite")):
        with pytest.raises(SceneError, match=said):
            sim.step(outputs=given)


@pytest.mark.parallel([2])
def test_ranks_agree(monkeypatch):
    check_ranks(both, monkeypatch)


@pytest.mark.parametrize(
    ("control", "said"),
    [
        ({"of": "m.x2"}, r'of = "m.x2" is no column.*did you mean "m.x"'),
        ({"acts": "body.m.mass"}, "acts = .* is no force or motor"),
        ({"acts": "body.q.force.x"}, "acts = .*there is no .q"),
        ({"kp": 0.0}, "kp and all other gains are 0"),
        ({"sample": 0.0, "delay": 0.1}, "delay = 0.1 s without sample"),
        ({"limits": [1.0, -1.0]}, "limits = .*smaller number first"),
        ({"ki": 1.0}, "ki is given, but a pd controller has none"),
        ({"of": "total_energy"}, "of = .* known only after the run"),
        ({"kind": "bang_bang", "kp": None}, "limits of a bang_bang controller"),
        ({"kind": "feedback", "of": None, "kp": None, "columns": ["m.x"], "formula": "m.x"},
         "formula = .*a dot"),
        ({"kind": "lqr", "of": None, "kp": None, "columns": ["m.x", "m.vx"],
          "model": {"state_matrix": [[1.0, 0.0], [0.0, 1.0]], "input_matrix": [0.0, 1.0]}},
         "model: no gains hold it"),
        ({"kind": "implicit_pd", "of": "contact_force"}, "rate = .*give its column"),
        ({"name": "vx"}, "name = .* cannot stand in a formula"),
    ],
)  # fmt: skip
def test_what_is_refused(control, said):
    with pytest.raises(SceneError, match=r"controller\[0\]\." + said):
        impactfem.solve(sliding(0.1, **{"kp": 10.0, "sample": 0.01} | control))


def test_what_is_told():
    def texts(scene):
        found = impactfem.solve(scene.with_settings({"solve.dt": 1e-3})).summary["verdict"][
            "findings"
        ]
        return [f["text"] for f in found if f["code"] == "controller"]

    assert any("lie within steps" in text for text in texts(
        turning(0.1, kp=10.0, kd=1.0, sample=0.0015)
    ))  # fmt: skip
    assert any("taken as 3 samples" in text for text in texts(
        sliding(0.1, kp=10.0, sample=0.01, delay=0.027)
    ))  # fmt: skip
    assert any("held over them" in text for text in texts(sliding(0.1, kind="pid", kp=1.0, ki=1.0)))


@pytest.mark.slow
def test_a_traction_of_the_impedance_takes_a_plane_wave():
    """u = rho c (0 - v) on the face of a strip that flies: 1 % of its energy after 2 L/c."""
    rho, modulus, nu, size = 7800.0, 210e9, 0.3, 0.0025
    speed = np.sqrt(modulus * (1 - nu) / ((1 + nu) * (1 - 2 * nu) * rho))
    body = {
        "kind": "solid", "name": "strip", "model": "plane_strain", "density": rho,
        "shape": {"kind": "block", "size": [0.1, 2 * size], "corner": [0.0, 0.0]},
        "mesh_size": size, "youngs_modulus": modulus, "poisson_ratio": nu, "velocity": [1.0, 0.0],
        "supports": [{"surface": side, "kind": "symmetry"} for side in ("bottom", "top")],
        "tractions": [{"surface": "right", "value": ["0", "0"]}],
    }  # fmt: skip
    damper = {"name": "damper", "kind": "p", "acts": "body.strip.tractions.0.value.x",
              "of": "end.vx", "kp": rho * speed}  # fmt: skip
    history = impactfem.solve(Scene.from_dict({
        "title": "strip", "duration": 2.05 * 0.1 / speed, "body": [body], "controller": [damper],
        "probe": [{"name": "end", "body": "strip", "point": [0.1, size]}],
        "solve": {"method": "explicit", "courant": 0.2, "estimate": False},
    })).history  # fmt: skip
    energy = history["kinetic_energy"].values + history["elastic_energy"].values
    assert energy[-1] < 0.01 * energy[0]
