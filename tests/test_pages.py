"""What README and pages show works as it stands there, and is complete."""

import ast
import doctest
import inspect
import math
import re
import tomllib
from pathlib import Path

import jax
import pytest

import drumsqueal
import scene_reference
from drumsqueal import command_line as cli
from drumsqueal.scene import COORDINATES, load_scene

ROOT = Path(__file__).parents[1]
ABOVE = {"index.md", "CONTRIBUTING.md", "CHANGELOG.md", "seo_kang_2023.md"}  # which the site takes from above
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(page: str, language: str) -> list[str]:
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


def test_the_scene_loads_and_is_the_nominal_one_with_more_effects(tmp_path, nominal):
    block = blocks("scene.md", "toml")[0]
    file = tmp_path / "scene.toml"
    file.write_text(block, encoding="utf-8")
    more = {"damping": {"ratio": 0.005}, "forcing": {"amplitude": {"Y": 0.1}, "frequency": 1000.0}}
    more |= {"temperature": {"heat_capacity": 300.0, "cooling": 2.0, "fade": 0.001}}
    assert load_scene(file) == nominal.with_values(more)


@pytest.mark.thorough
def test_the_python_lines_run_and_the_gradient_is_right(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    names: dict = {}
    first, *others = blocks("python.md", "python")[:-2]  # those of the chapter on notebooks are tested there
    exec(compile(first, "python.md", "exec"), names)  # the point of this test
    told = capsys.readouterr().out.splitlines()
    assert len([line for line in first.splitlines() if line]) <= 10
    assert [line.split()[0] for line in told[:3]] == ["Y", "X", "Tz"]
    assert "predicts squeal in Y, X, Tz" in told[-1]
    for block in others:
        exec(compile(block, "python.md", "exec"), names)
    printed = capsys.readouterr().out.splitlines()
    assert float(printed[0]) > 1e-5  # squeal has grown to tens of micrometres by then
    assert "predicts squeal" in printed[1]
    gradient, step = names["gradient"], 1e-4
    numbers = ({"drum.speed": 3.0 + change, "contact.normal_load": 2000.0} for change in (step, -step))
    # The values beside the gradient, by the programs that it has been compiled into.
    higher, lower = (float(jax.value_and_grad(names["growth"])(values)[0]) for values in numbers)
    # Central differences of a rate near 100 1/s with steps of 1e-4 are good to about 1e-7.
    assert gradient["drum.speed"] == pytest.approx((higher - lower) / (2 * step), rel=1e-6)
    assert math.isfinite(gradient["contact.normal_load"])
    assert names["squeal"].findings.outcome == "complete"
    assert "friction_law" in names["squeal"].history.attrs
    assert names["largest"].shape == (8,)
    assert (names["largest"] > 1e-6).all()
    assert (names["boundary"].values[:2] > 0).all()  # below the critical speed of 10.6 rad/s
    assert {line.split()[0] for line in printed[-4:-1]} == {"X", "Y", "Tz"}
    times, sticks = zip(*ast.literal_eval(printed[-1]), strict=True)
    assert sticks[:4] == (True, False, True, False)
    # The exact times of Coulomb's block: 2 Δ/V and 2 (π − arctan(Δ/V)), with Δ = 0.5 and V = 0.2.
    assert times[2] - times[1] == pytest.approx(2 * (math.pi - math.atan(2.5)), rel=1e-6)
    assert times[3] - times[2] == pytest.approx(5.0, rel=1e-6)


def anchors(page: Path) -> set[str]:
    """Of all headings, as they are made where the page is shown."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_and_picture_leads_somewhere(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.is_file(), link
        assert not anchor or anchor in anchors(target), link


def test_the_readme_is_short_and_has_every_command():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) < 120
    told = re.findall(r"^\| \[?`(\w+)`", text, flags=re.MULTILINE)
    assert sorted(told) == sorted(name for group in cli.GROUPS.values() for name in group)


def test_every_page_is_reached():
    site = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    pages = {path.name for suffix in ("md", "ipynb") for path in (ROOT / "docs").glob(f"*.{suffix}")}
    assert pages == set(re.findall(r"(\w+\.(?:md|ipynb))$", site, flags=re.MULTILINE)) - ABOVE


def test_every_picture_says_what_it_is_made_from():
    drawn = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        shown = re.findall(r"\]\((?:docs/)?([\w-]+\.(?:png|gif))\)", text)
        made = re.findall(r"\]\((?:docs/)?([\w-]+\.(?:png|gif))\)\n<!-- from .+ -->", text)
        assert set(shown) - set(made) <= {"drawing.png"} | drawn, page.name  # which renew.py draws itself
        drawn |= set(made)
    there = {path.name for suffix in ("png", "gif") for path in (ROOT / "docs").glob(f"*.{suffix}")}
    assert there == drawn | {"drawing.png"}


def test_the_reference_of_keys_is_that_of_the_models():
    assert scene_reference.PAGE.read_text(encoding="utf-8") == scene_reference.page(), (
        "run docs/_make/scene_reference.py"
    )
    for part in scene_reference.parts(drumsqueal.Scene):
        assert set(part.model.model_fields) <= set(scene_reference.meanings(part.model)), part.heading


def test_the_python_reference_has_every_public_name():
    text = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    told = re.findall(r"^::: drumsqueal\.(\w+)$", text, re.MULTILINE)
    assert sorted(told) == drumsqueal.__all__


EXAMPLES = {
    name: "".join(code)
    for name in drumsqueal.__all__
    if (code := re.findall(r"```pycon\n(.*?)```", inspect.getdoc(getattr(drumsqueal, name)) or "", flags=re.DOTALL))
}


@pytest.mark.thorough(but=["integrate", "load_scene", "scene_from_dict"])
@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_of_the_python_reference_print_what_stands_there(name):
    example = doctest.DocTestParser().get_doctest(EXAMPLES[name], {"drumsqueal": drumsqueal}, name, None, None)
    told: list[str] = []
    doctest.DocTestRunner().run(example, out=told.append)
    assert not told, "".join(told)


@pytest.mark.thorough
def test_the_brake_of_the_tutorial_has_the_eigenvalues_that_stand_there(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(blocks("tutorial.md", "toml")[0], encoding="utf-8")
    text = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    for settings in ((), ("friction.static=0.38", "damping.ratio=0.03")):
        model = drumsqueal.build_model(load_scene(file, settings), coordinates=COORDINATES)
        for mode in drumsqueal.analyse_stability(model).modes:
            row = (mode.label, f"{mode.frequency_Hz:.2f} Hz", f"{mode.growth_rate:+.3f} 1/s")
            assert re.search(" +".join(map(re.escape, row)), text), row


def test_the_version_is_everywhere_the_same():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\n## {version}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_every_public_name_is_there_and_tells_what_it_is():
    assert sorted(drumsqueal.__all__) == sorted(drumsqueal._HOME)
    for name in drumsqueal.__all__:
        assert getattr(drumsqueal, name).__doc__
    with pytest.raises(AttributeError, match="no attribute 'solved'"):
        drumsqueal.solved  # noqa: B018 (to look it up is the test)  # pyright: ignore[reportAttributeAccessIssue]
