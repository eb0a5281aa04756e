"""Policies and critic laws of a user's files: made once, told apart, refused in one sentence."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from stationkeep.comparison import Scenario, compare, replay
from stationkeep.comparison.policies import contender, label_of, require_own
from stationkeep.comparison.records import contender_record, online_record, provenance
from stationkeep.online import LearnedPolicy, Learner, LearnerSettings, load, save, simulate
from stationkeep.symbolic import InputError, two_state_game

from .games import two_state

Check = Callable[[BaseException], str]
POLICIES = """
def make(setup): return lambda zeta: [-zeta[1]]
def other(setup): return lambda zeta: [-2.0 * zeta[1]]
def wrong(setup): return lambda zeta: [1.0, 2.0]
def fails(setup): return lambda zeta: [{}[0]]
def number(setup): return 3
def breaks(setup): return {}["gain"]
class Steps:
    u_control = u_disturbance = None
    def __init__(self, setup): pass
    def step(self, zeta, dt): return [1.0, 2.0]
def learned(setup): return lambda zeta: [0.0]
"""
LAWS = """
steps = []
class Half:
    def __init__(self, setup): self.m = setup.basis.n_basis
    def step(self, critic, rows, dt):
        steps.append((self.m, rows.matrix.shape, dt))
        return 0.5 * critic
class Short(Half):
    def step(self, critic, rows, dt): return critic[1:]
class Fails(Half):
    def step(self, critic, rows, dt): return critic / {}["gain"]
def number(setup): return 3
"""
PROBLEM = "from stationkeep.symbolic import two_state_game\nproblem = two_state_game()\n"
SHORT = ("samples.number=20", "simulation.duration=0.6")


@pytest.fixture
def files(tmp_path: Path) -> Path:
    for name, text in (("mine", POLICIES), ("laws", LAWS), ("plant", PROBLEM)):
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    return tmp_path


def scenario(files: Path, *overrides: str) -> Scenario:
    return Scenario.load(f"{files}/plant.py:problem", [*SHORT, *overrides])


def with_law(files: Path, name: str) -> Scenario:
    return scenario(files, f"learner.rule='{files}/laws.py:{name}'", "learner.safeguard=false")


def test_labels() -> None:
    assert label_of("learned") == "learned"
    assert label_of("a/mine.py:make") == "mine"
    assert label_of("a/mine.py:other") == "other"


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["linear"], "'linear' is no policy of your own"),
        (["mine.py:learned"], "two policies are called 'learned'"),
        (["mine.py:make", "mine.py:make"], "two policies are called 'mine'"),
        (["mine.py:breaks"], "mine.py:breaks' raises KeyError: 'gain'"),
        (["mine.py:number"], "mine.py:number' returns a int"),
        (["mine.py:none"], "has no function 'none'"),
        (["none.py:make"], "no Python file"),
    ],
)
def test_what_is_no_policy_is_refused_before_a_run(
    names: list[str], words: str, files: Path, monkeypatch: pytest.MonkeyPatch, one_sentence: Check
) -> None:
    monkeypatch.chdir(files)
    with pytest.raises(InputError, match=words) as caught:
        compare(scenario(files), states=1, out=files / "out", policies=names)
    one_sentence(caught.value)
    assert not (files / "out").exists()
    require_own(["mine.py:make", "mine.py:other"], scenario(files).setup())


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("wrong", "shape (2,), but the problem needs 1 numbers"),
        ("Steps", "shape (2,), but the problem needs 1 numbers"),
        ("fails", "mine.py:fails' raises KeyError: 0"),
    ],
)
def test_a_policy_that_fails_ends_its_run_and_says_why(name: str, words: str, files: Path) -> None:
    record = contender_record(scenario(files), f"{files}/mine.py:{name}")
    assert "the controller failed at t = 0.00 s" in record.attrs["stopped"]
    assert words in record.attrs["stopped"]


def test_a_record_is_another_when_the_file_is(files: Path) -> None:
    """The key holds the file of the policy, or of the law; that of a shipped policy has neither."""
    name, path = f"{files}/mine.py:make", files / "record.nc"
    first = contender_record(scenario(files), name, path)
    np.testing.assert_allclose(first["u_control"][:, 0], -first["zeta"][:, 1])
    assert contender_record(scenario(files), name, path).attrs["key"] == first.attrs["key"]
    text = POLICIES.replace("[-zeta[1]]", "[-3.0 * zeta[1]]")
    (files / "mine.py").write_text(text, encoding="utf-8")
    second = contender_record(scenario(files), name, path)
    assert second.attrs["key"] != first.attrs["key"]
    np.testing.assert_allclose(second["u_control"][:, 0], -3.0 * second["zeta"][:, 1])
    keys = []
    for factor in ("0.5", "0.6"):
        (files / "laws.py").write_text(LAWS.replace("0.5", factor), encoding="utf-8")
        keys.append(
            [provenance(one, "learned")["key"] for one in (with_law(files, "Half"), scenario(files))]
        )
    assert keys[0][0] != keys[1][0]
    assert keys[0][1] == keys[1][1]


def test_a_law_moves_the_critic(files: Path) -> None:
    """Half of what it was at each learning step, and made anew for each learner."""
    one = with_law(files, "Half")
    for _ in range(2):
        policy = LearnedPolicy(one)
        start = policy.learner.critic.copy()
        record = simulate(two_state_game(), policy, [0.5, -0.5], 0.6, control_period=0.1)
        halves = start * 0.5 ** np.arange(record.sizes["learn_time"])[:, None]
        np.testing.assert_allclose(record["critic"], halves, rtol=1e-12)


def test_a_law_is_found_beside_the_scenario(
    files: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = 'problem = "plant.py:problem"\n[learner]\nrule = "laws.py:Half"\n'
    (files / "mine.toml").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    law = Scenario.load(files / "mine.toml").critic_law()
    assert law is not None
    assert Scenario.load(f"{files}/plant.py:problem").critic_law() is None


@pytest.mark.parametrize(
    ("name", "words"),
    [("number", "returns a int"), ("none", "has no function"), ("steps", "no function .steps.")],
)
def test_what_is_no_law_is_refused(name: str, words: str, files: Path, one_sentence: Check) -> None:
    with pytest.raises(InputError, match=words) as caught:
        with_law(files, name).critic_law()
    one_sentence(caught.value)


@pytest.mark.parametrize(
    ("name", "words"), [("Short", "weights of shape (2,)"), ("Fails", "raises KeyError: 'gain'")]
)
def test_a_law_that_fails_ends_its_run_and_says_why(name: str, words: str, files: Path) -> None:
    record = online_record(with_law(files, name))
    assert words in record.attrs["stopped"]


def test_a_learner_does_not_load_a_law(one_sentence: Check) -> None:
    problem, basis, functions = two_state()
    settings = LearnerSettings(rule="laws.py:Half")
    with pytest.raises(InputError, match="give that law to the learner") as caught:
        Learner(problem, basis, settings, np.zeros((0, 2)), np.ones(3), functions=functions)
    one_sentence(caught.value)


def test_a_record_never_runs_a_file(files: Path, one_sentence: Check) -> None:
    """Neither the law that it names, nor a basis or a policy; what needs none of them runs again."""
    trap = 'from pathlib import Path\nPath(__file__).with_name("ran").touch()\n'
    (files / "basis.py").write_text(
        "from stationkeep.symbolic import quadratic\ndef sigma(x): return quadratic(x)\n",
        encoding="utf-8",
    )
    taught, linear, drawn, own = (files / f"{name}.nc" for name in ("law", "linear", "basis", "own"))
    online_record(with_law(files, "Half"), taught)
    contender_record(with_law(files, "Half"), "linear", linear)
    contender_record(scenario(files), f"{files}/mine.py:make", own)
    made = online_record(scenario(files, f"basis.name='{files}/basis.py:sigma'"))
    save(made.drop_vars("basis_function"), drawn)
    for name in ("laws", "mine", "basis", "plant"):
        (files / f"{name}.py").write_text(trap, encoding="utf-8")
    with pytest.raises(InputError, match="basis_function") as caught:
        replay(drawn)
    one_sentence(caught.value)
    for path in (taught, own):
        answer = replay(path)
        assert answer.verdict == "bit-equal", "played back"
        assert {"zeta", "u_control", "cost"} < set(answer.differences)
        assert "critic" not in answer.differences
        assert any("no part of the record" in change for change in answer.changed)
    answer = replay(linear)
    assert (answer.max_difference, load(linear).attrs["kind"]) == (0.0, "linear")
    assert not (files / "ran").exists()


def test_a_program_runs_again_where_the_user_names_it(files: Path, one_sentence: Check) -> None:
    """From anywhere, if it is the one of the record."""
    taught, own = files / "law.nc", files / "own.nc"
    online_record(with_law(files, "Half"), taught)
    contender_record(scenario(files), f"{files}/mine.py:make", own)
    elsewhere = files / "elsewhere"
    elsewhere.mkdir()
    for name, path, function in (("laws", taught, "Half"), ("mine", own, "make")):
        file = (files / f"{name}.py").rename(elsewhere / f"{name}.py")
        answer = replay(path, policy=f"{file}:{function}")
        assert answer.verdict == "bit-equal"
        assert "zeta" in answer.differences
        file.write_text(file.read_text(encoding="utf-8") + "\n# changed\n", encoding="utf-8")
        with pytest.raises(InputError, match="hash of its file is another") as caught:
            replay(path, policy=f"{file}:{function}")
        one_sentence(caught.value)
    with pytest.raises(InputError, match=r"must be file.py:function"):
        replay(own, policy="learned")
    linear = files / "linear.nc"
    contender_record(scenario(files), "linear", linear)
    with pytest.raises(InputError, match="leave out --policy"):
        replay(linear, policy=f"{elsewhere}/mine.py:make")


def test_wrenches_of_a_vehicle_are_played_back(tmp_path: Path) -> None:
    """With an observer and thrusters in the run, whose work is in the wrench that the vehicle got."""
    (tmp_path / "mine.py").write_text("def make(setup): return lambda zeta: -20.0 * zeta[6:]\n")
    sets = ("mode='disturbed'", "duration=0.4", "thruster_limits=true", "observer_bandwidth=0.5")
    one = Scenario.load(overrides=[f"simulation.{text}" for text in sets])
    path = tmp_path / "run.nc"
    contender_record(one, f"{tmp_path}/mine.py:make", path)
    (tmp_path / "mine.py").unlink()
    answer = replay(path)
    assert answer.verdict == "bit-equal"
    assert {"zeta", "tau_b", "u_control", "cost"} < set(answer.differences)
    record = load(path)
    record["tau_b"][5] += 1e-3
    save(record, path)
    assert replay(path).first == ("u_control", 0.1)


def test_contender_makes_what_the_file_does(files: Path) -> None:
    one = scenario(files)
    policy = contender(f"{files}/mine.py:other").make(one)
    np.testing.assert_array_equal(policy.step(np.array([0.3, 0.2]), 0.1), [-0.4])  # type: ignore[call-arg,arg-type]
