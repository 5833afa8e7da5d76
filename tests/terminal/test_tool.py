"""The command line as a tool: help and its examples, completion, answers as JSON, colours, shipped scenes, check."""

import json
import math
import os
import pty
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from drumsqueal import command_line as cli
from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import FORMATS, to_json
from drumsqueal.questions.check import Check, check_scene, warnings_of
from drumsqueal.questions.export.signals import known_signals
from drumsqueal.scene import load_scene, setting_choices
from drumsqueal.scene.file import find_scene, shipped_names, shipped_scenes, written
from drumsqueal.simulation import prepare, run
from drumsqueal.terminal.options import SIGNALS
from drumsqueal.terminal.reply import UNBROKEN, Reply, make_console
from processes import PATIENCE, shown_on

PULSE = "{time=[0, 0.1, 0.1000005, 0.100001], value=[2000, 2000, 8e5, 2000]}"  # between two samples

ROOT = Path(__file__).parents[2]
NOMINAL = str(ROOT / "scenarios" / "nominal.toml")
COMMANDS = [(name, command) for group in cli.GROUPS.values() for name, command in group.items()]
SHORT = ("--set", "simulate.duration=0.002")


# Help.


@pytest.mark.parametrize(("name", "command"), COMMANDS, ids=[name for name, _ in COMMANDS])
def test_every_command_has_an_example_that_its_parser_takes(name, command, monkeypatch):
    monkeypatch.chdir(ROOT)
    (example,) = re.findall(r"Example:\n\s+(drumsqueal .*)", cli.help_text(command))
    assert len(example) <= 76  # one line of the help on a terminal of 80 columns
    program, called, *arguments = shlex.split(example)
    assert (program, called) == ("drumsqueal", name)
    tree = cli.command_tree()
    context = tree.commands[name].make_context(name, arguments)  # raises for what it does not know
    scene = context.params.get("scene")
    if scene is not None:
        load_scene(scene, context.params["settings"] or ())


def test_help_tells_no_type_of_flags_and_keeps_its_brackets(drumsqueal):
    status, printed, errors = drumsqueal("sweep", "--help")
    assert (status, errors) == (0, "")
    assert "<bool>" not in printed
    assert "[uncertain]" in " ".join(printed.split())
    assert "KEY=FROM..TO[xN]" in printed


def test_commands_stand_in_groups_and_each_purpose_in_one_line(drumsqueal, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    printed = drumsqueal("--help")[1]
    places = [printed.index(f"─ {group} ─") for group in cli.GROUPS]
    assert places == sorted(places)
    for name, command in COMMANDS:
        purpose = cli.help_text(command).split("\n\n")[0].replace("\\[", "[")
        room = "the first sentence of its docstring has no room on a line of 80 columns"
        assert re.search(rf"│ {name} +{re.escape(purpose)} +│", printed), f"{name}: {room}"


def test_version(drumsqueal):
    assert drumsqueal("--version") == (0, "drumsqueal 0.1.0\n", "")


# Completion.


def completed(monkeypatch, capsys, *words: str) -> list[str]:
    """What bash is offered for the last word."""
    monkeypatch.setenv(
        "COMP_WORDS", shlex.join(("drumsqueal", *words)) if words[-1] else f"{shlex.join(('drumsqueal', *words[:-1]))} "
    )
    monkeypatch.setenv("COMP_CWORD", str(len(words)))
    monkeypatch.setenv(cli.COMPLETION, "complete_bash")
    monkeypatch.setattr(sys, "argv", ["drumsqueal"])
    with pytest.raises(SystemExit):
        cli.main()
    return capsys.readouterr().out.split()


def test_completion_offers_commands_options_scenes_and_keys(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(cli, "prepare_environment", lambda: None)
    assert completed(monkeypatch, capsys, "st") == ["stability"]
    assert completed(monkeypatch, capsys, "run", "x.toml", "--ov") == ["--overwrite"]
    assert completed(monkeypatch, capsys, "scenes", "") == list(shipped_names())
    assert completed(monkeypatch, capsys, "run", NOMINAL, "--set", "friction.k") == ["friction.kinetic="]
    assert completed(monkeypatch, capsys, "run", NOMINAL, "--set", "shoe.force") == [
        *("shoe.force.0.at=", "shoe.force.0.direction=", "shoe.force.0.radius=", "shoe.force.0.size="),
    ]
    assert completed(monkeypatch, capsys, "onset", NOMINAL, "--along", "dr") == ["drum.speed="]
    assert completed(monkeypatch, capsys, "onset", NOMINAL, "--along", "damping") == []  # it has none
    assert completed(monkeypatch, capsys, "onset", "damped", "--along", "damping") == ["damping.ratio="]
    assert completed(monkeypatch, capsys, "sensitivity", "stop", "--vary", "shoe.width,dr") == []  # a profile
    monkeypatch.chdir(tmp_path)
    (tmp_path / "noise.toml").touch()
    (tmp_path / "notes.txt").touch()
    assert completed(monkeypatch, capsys, "run", "no") == ["noise.toml", "nominal"]
    (tmp_path / "north").mkdir()
    assert completed(monkeypatch, capsys, "run", "no") == []  # the shell itself offers files and folders
    (tmp_path / "north" / "a.toml").touch()
    assert completed(monkeypatch, capsys, "run", "north/") == ["north/a.toml"]
    assert completed(monkeypatch, capsys, "run", "nowhere/") == []


def test_completion_offers_the_words_that_an_option_takes(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(cli, "prepare_environment", lambda: None)
    monkeypatch.chdir(tmp_path)
    assert completed(monkeypatch, capsys, "export", "x.nc", "--to", "") == list(FORMATS)
    assert completed(monkeypatch, capsys, "export", "x.nc", "--signals", "brake_torque,velocity_T") == [
        "brake_torque,velocity_Tx",
        "brake_torque,velocity_Ty",
        "brake_torque,velocity_Tz",
    ]
    assert completed(monkeypatch, capsys, "compare", "x.nc", "y.csv", "--signal", "normal") == ["normal_force"]
    assert completed(monkeypatch, capsys, "animate", "damped", "--mode", "T") == ["Tx", "Ty", "Tz"]
    assert completed(monkeypatch, capsys, "sweep", "damped", "--cluster", "") == ["local"]
    assert completed(monkeypatch, capsys, "sensitivity", "damped", "--until", "") == ["stable"]
    assert completed(monkeypatch, capsys, "run", "damped", "--set", "simulate.solver=dopri") == [
        "simulate.solver=dopri5",
        "simulate.solver=dopri8",
    ]
    (tmp_path / "noise.nc").touch()
    assert completed(monkeypatch, capsys, "animate", "no") == ["noise.nc", "nominal"]


def test_the_choices_of_a_key_are_those_that_a_scene_takes(nominal):
    assert set(setting_choices("friction.law")) >= {"constant", "exponential", "stribeck", "table"}
    assert setting_choices("contact.separation") == ("true", "false")
    assert setting_choices("drum.speed") == setting_choices("title") == setting_choices("nowhere") == ()
    for key in ("simulate.solver", "steady.state", "friction.direction"):
        for word in setting_choices(key):
            assert load_scene(NOMINAL, [f"{key}={word}"])


def test_the_signals_that_are_offered_are_those_that_can_go_out():
    assert set(SIGNALS) == {*known_signals()}


def test_the_commands_are_known_before_anything_that_computes_is_loaded():
    # What JAX is to keep, and where, it reads when it is imported: by then the command line must have said so.
    code = "import sys, drumsqueal.command_line; print({'jax', 'xarray', 'scipy', 'matplotlib'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("set()\n", "")


def test_completion_in_a_process_of_its_own():
    told = {"COMP_WORDS": "drumsqueal sensi", "COMP_CWORD": "1", cli.COMPLETION: "complete_bash"}
    done = subprocess.run([sys.executable, "-m", "drumsqueal"], env=os.environ | told, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("sensitivity\n", "")


# Answers.


@pytest.mark.usefixtures("empty_figures")
def test_a_run_answers_as_json_alone_or_not_at_all(drumsqueal, tmp_path):
    status, printed, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path / "a"), *SHORT, "--json", "-")
    assert (status, errors) == (0, "")
    assert json.loads(printed) == json.loads((tmp_path / "a" / "summary.json").read_text())
    status, printed, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path / "a"), *SHORT, "--quiet")
    assert (status, printed) == (2, "")
    assert "--overwrite" in errors
    assert drumsqueal("stability", NOMINAL, "-q") == (0, "", "")


def test_every_command_takes_quiet_and_json():
    for name, command in cli.command_tree().commands.items():
        taken = {option for parameter in command.params for option in parameter.opts}
        assert {"--quiet", "--json", "--overwrite"} <= taken, name


@pytest.mark.thorough
def test_other_commands_answer_with_what_they_write(drumsqueal, tmp_path):
    folder = str(tmp_path / "map")
    vary = ("--vary", "drum.speed=2..4x2", "--vary", "contact.normal_load=1000..2000x2")
    status, printed, errors = drumsqueal("sweep", NOMINAL, "-o", folder, *vary, "--json", "-")
    assert (status, errors) == (0, "")
    assert json.loads(printed) == json.loads((tmp_path / "map" / "sweep.json").read_text())


def test_an_answer_is_not_overwritten_unasked(drumsqueal, tmp_path):
    file = tmp_path / "modes.json"
    assert drumsqueal("stability", NOMINAL, "--json", str(file)) == (0, "", "")
    before = file.read_text()
    status, printed, errors = drumsqueal("stability", NOMINAL, "--json", str(file), "--set", "drum.speed=3")
    assert (status, printed) == (2, "")
    assert f"{file} exists; add --overwrite to replace it, or name another file with --json" in errors
    assert file.read_text() == before
    again = ("--set", "drum.speed=3", "--overwrite")
    assert drumsqueal("stability", NOMINAL, "--json", str(file), *again)[0] == 0
    assert file.read_text() != before


@pytest.mark.parametrize("name", ["", "nowhere/x.json", "."])
def test_an_answer_that_cannot_be_written_is_refused_at_once(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RequestError, match="--json"):
        Reply(False, name, overwrite=False)


def test_an_answer_goes_into_a_pipe(tmp_path):
    read, write = os.pipe()
    with os.fdopen(read) as end:
        reply = Reply(False, f"/dev/fd/{write}", overwrite=False)
        reply.send({"a": math.nan})
        os.close(write)
        assert json.load(end) == {"a": None}


# Colours and widths.


def on_a_terminal(*arguments: str, **environment: str) -> str:
    """What the program writes to a terminal of its own."""
    leader, follower = pty.openpty()
    plain = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "FORCE_COLOR", "COLUMNS")}
    program = subprocess.Popen(
        [sys.executable, "-m", "drumsqueal", *arguments],
        env=plain | {"TERM": "xterm-256color"} | environment,
        stdin=follower, stdout=follower, stderr=follower,
    )  # fmt: skip
    os.close(follower)
    written = shown_on(leader)
    assert program.wait(timeout=PATIENCE) == 0
    return written.decode()


COLOUR = re.compile(r"\x1b\[(?:[0-9]+;)*(?:3[0-8]|48|9[0-7])(?:;[0-9]+)*m")


@pytest.mark.thorough
def test_colours_are_for_terminals_that_want_them():
    assert COLOUR.search(on_a_terminal("--help"))
    assert not COLOUR.search(on_a_terminal("--help", NO_COLOR="1"))
    assert "\x1b" not in on_a_terminal("--help", TERM="dumb")
    assert "\x1b" not in on_a_terminal("scenes", TERM="dumb")
    piped = subprocess.run([sys.executable, "-m", "drumsqueal", "--help"], capture_output=True, text=True)
    assert "\x1b" not in piped.stdout


def test_a_pipe_gets_whole_lines(monkeypatch, capsys):
    monkeypatch.delenv("COLUMNS", raising=False)
    make_console().print("word " * 100)
    assert capsys.readouterr().out.count("\n") == 1
    assert make_console().width == UNBROKEN
    monkeypatch.setenv("COLUMNS", "60")
    assert make_console().width == 60


# Shipped scenes.


def test_the_shipped_scenes_are_those_of_the_repository():
    assert shipped_names() == tuple(sorted(path.stem for path in (ROOT / "scenarios").glob("*.toml")))
    for scene in shipped_scenes():
        assert load_scene(scene.path).title == scene.title
        assert scene.shows.endswith((".", "`"))


def test_a_shipped_scene_is_named_where_its_name_finds_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path, own = find_scene("damped"), tmp_path / "damped.toml"
    assert (written(path), written(own)) == ("damped", str(own))
    (tmp_path / "damped").write_text("title =")  # which the name finds now
    assert written(path) == str(path)


def test_a_scene_is_copied_and_not_over_another(drumsqueal, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert drumsqueal("scenes", "damped")[0] == 0
    assert (tmp_path / "damped.toml").read_bytes() == (ROOT / "scenarios" / "damped.toml").read_bytes()
    status, printed, errors = drumsqueal("scenes", "damped")
    assert (status, printed) == (2, "")
    assert "damped.toml exists; add --overwrite" in errors
    assert drumsqueal("scenes", "damped", "--overwrite")[0] == 0
    assert drumsqueal("scenes", "stop", "-o", "mine.toml", "--quiet") == (0, "", "")
    assert load_scene("mine.toml").title == "Stop from 5 rad/s"
    assert "there are constant_friction, damped" in drumsqueal("scenes", "xyz")[2]
    assert "did you mean damped?" in drumsqueal("scenes", "dampd")[2]
    assert "did you mean the shipped scene damped?" in drumsqueal("check", "dampd")[2]
    assert "name the scene, too" in drumsqueal("scenes", "-o", "x.toml")[2]
    names = [scene["name"] for scene in json.loads(drumsqueal("scenes", "--json", "-")[1])]
    assert tuple(names) == shipped_names()


def test_the_name_of_a_shipped_scene_stands_for_it_where_there_is_no_file(drumsqueal, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert find_scene("damped").name == "damped.toml"
    assert json.loads(drumsqueal("stability", "damped", "--json", "-")[1])["modes"]
    (tmp_path / "damped").mkdir()  # as results of it may be called
    assert json.loads(drumsqueal("stability", "damped", "--json", "-")[1])["modes"]
    assert "history.nc: there is no such file" in drumsqueal("animate", "damped", "--mode", "Y")[2]
    (tmp_path / "damped").rmdir()
    (tmp_path / "damped").write_text("title =")
    assert "not TOML" in drumsqueal("stability", "damped")[2]
    assert "drumsqueal scenes" in drumsqueal("stability", "nowhere.toml")[2]


# Check.


def test_check_tells_the_derived_numbers(drumsqueal):
    status, printed, errors = drumsqueal("check", NOMINAL, "--json", "-")
    assert (status, errors) == (0, "")
    told = json.loads(printed)
    value = {name: each["value"] for name, each in told["numbers"].items()}
    # Closed forms of Table 1 with nine digits: mass, centre and p0 as worked out by hand, the rest beside it.
    assert value["mass"] == pytest.approx(1.16571623, rel=5e-9)
    assert value["centre of gravity"] == pytest.approx(72.1956531e-3, rel=5e-9)
    assert value["mean pressure p0"] == pytest.approx(241499.598, rel=5e-9)
    assert value["friction coefficient"] == pytest.approx(0.42130613, rel=2e-8)
    assert value["slope of friction"] == pytest.approx(-0.12130613, rel=5e-8)
    assert value["lifting displacement"] == pytest.approx(241499.598 / 0.35e11, rel=5e-9)
    assert value["sliding speed"] == pytest.approx(0.5)
    half = math.radians(65)
    # Displacement and velocity of the ends of the lining when Tz alone turns.
    assert value["lifting rotation"] * 72.1956531e-3 * math.sin(half) == pytest.approx(6.89998851e-6, rel=1e-8)
    assert value["reversing rotation"] * (0.1 - 72.1956531e-3 * math.cos(half)) == pytest.approx(0.5, rel=1e-8)
    assert told["least_sample_rate_Hz"] == pytest.approx(2 * told["highest_frequency_Hz"])
    assert (told["samples"], told["warnings"]) == (20001, [])
    assert [each["label"] for each in told["growing"]] == ["Y", "X", "Tz"]


def test_check_foretells_the_first_boundary_and_the_evaluations(nominal):
    scene = nominal.with_values({"simulate.duration": 0.1})
    check, result = check_scene(scene, measure=True), run(scene)
    boundary = result.findings.edge_reached_s
    assert check.first_edge_s is not None
    assert boundary is not None
    # One mode alone, against the motion of three together: the others bring it there somewhat sooner.
    assert boundary <= check.first_edge_s <= 1.05 * boundary
    steps = result.history.attrs["steps"]
    assert check.estimate is not None
    assert check.estimate.evaluations == pytest.approx(12 * steps, rel=0.3)  # the estimate is rough by its nature
    assert check.estimate.integration_s is not None
    data = to_json(check)
    assert to_json(Check.model_validate(json.loads(data))) == data


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (("start.displacement.Y=1e-5",), "beyond the contact boundaries, at 1.44 times that of loss of contact"),
        (("start.displacement={}",), "Nothing is started and no force acts"),
        pytest.param(
            ("start.displacement={}", f"contact.normal_load={PULSE}"),
            "Nothing is started and no force acts",
            marks=pytest.mark.thorough,
        ),
        pytest.param(
            ("start.displacement={}", f"contact.normal_load={PULSE}", "steady.state=self-consistent"),
            "Nothing is started, but the changing load moves the shoe",
            marks=pytest.mark.thorough,
        ),
        (
            ("start.displacement={Y=1e-7}", 'simulate.coordinates=["X", "Z"]', "start.displacement={X=1e-7}"),
            "Held at zero",
        ),
        (("simulate.duration=0.01",), "The duration of 0.01 s is 0.762 e-folding times"),
        (("simulate.duration=0.08",), "may not have settled by its end; take at least 0.084 s"),
        (("damping.ratio=0.3",), "Note: damping.ratio = 0.3 is far from what drum brakes have, 0 to 0.1 (10 %)"),
        (("simulate.sample_rate=20000",), "The sample rate is 2.7 times the highest frequency"),
    ],
)
def test_check_warns_in_plain_words(nominal, settings, told, drumsqueal):
    arguments = [each for setting in settings for each in ("--set", setting)]
    status, printed, errors = drumsqueal("check", NOMINAL, *arguments)
    assert (status, errors) == (0, "")
    assert told in " ".join(printed.split())


@pytest.mark.parametrize("command", ["check", "run"])
def test_a_number_in_a_wrong_unit_is_told_beside_what_it_brings_about(command, drumsqueal, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, printed, errors = drumsqueal(command, NOMINAL, "--set", "shoe.density=7.82")
    assert (status, errors.count("\n")) == (2, 1)
    assert "twice the highest frequency" in errors
    assert "did you mean 7.82 g/cm^3?" in " ".join(printed.split())
    assert list(tmp_path.iterdir()) == []


def test_check_warns_where_the_lining_does_not_press_everywhere(nominal):
    prepared = prepare(nominal)
    lifted = prepared._replace(stability=prepared.stability._replace(contact_fraction=0.8))
    (told,) = warnings_of(lifted, (), (0.0, 0.0))
    assert "presses on 80 % of its area only" in told


def test_check_refuses_what_a_run_refuses_and_writes_nothing(drumsqueal, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for setting, why in (("drum.sped=3", "drum.speed"), ("simulate.sample_rate=10000", "14797")):
        status, printed, errors = drumsqueal("check", NOMINAL, "--set", setting, "--json", "x.json")
        assert (status, printed, errors.count("\n")) == (2, "", 1)
        assert why in errors
    assert list(tmp_path.iterdir()) == []
