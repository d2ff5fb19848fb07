"""Pages in a real browser, asked by axe-core: ``python -m benchmarks.scale.accessibility``.

The pages of five commands, light on a desk and dark on a phone: findings of axe-core by how serious they are, what the browser's
console says, and what the page asks of a network. Needs chromium, and ``pip install thermofast[browser]`` for axe-core.
"""

import html
import importlib.util
import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
#: For a page that runs its scripts and is then printed as it stands, with what they said.
FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --enable-logging=stderr --v=0 --virtual-time-budget=20000 --dump-dom"
)
#: How a page is looked at: (name, arguments of the browser).
VIEWS = (
    ("light, desk", ("--window-size=1280,900",)),
    ("dark, phone", ("--window-size=390,844", "--blink-settings=preferredColorScheme=0")),
)
#: Levels of axe-core, the worst first.
LEVELS = ("critical", "serious", "moderate", "minor")
SPINDLE = "sample_runs/spindle.csv"
COMMANDS = {
    "identify": ("identify", SPINDLE, "--until", "60"),
    "sweep": ("sweep", SPINDLE, "--channels", "T1,T8"),
    "compare": ("compare", SPINDLE, "--until", "60"),
    "diagnose": ("diagnose", SPINDLE, "--channels", "T1,T8,T10"),
    "improve": ("improve", SPINDLE, "--channels", "T1,T8", "--auto"),
}
ASKED = """
<script>addEventListener("load", async () => {
  const found = await axe.run(), told = document.createElement("pre");
  told.id = "found";
  told.textContent = JSON.stringify({
    dark: matchMedia("(prefers-color-scheme: dark)").matches,
    passed: found.passes.length,
    fetched: performance.getEntriesByType("resource").length,
    violations: found.violations.map((v) => ({ rule: v.id, level: v.impact, at: v.nodes.map((n) => n.html) })),
  });
  document.body.append(told);
});</script>
"""


def axe_core() -> str:
    """The script of axe-core, from the package that ships it.

    Raises
    ------
    SystemExit: it is not installed.
    """
    found = importlib.util.find_spec("axe_playwright_python")
    if found is None or found.origin is None:
        raise SystemExit("axe-core is not installed: pip install thermofast[browser]")
    return (Path(found.origin).parent / "axe.min.js").read_text(encoding="utf-8")


def in_browser(page: Path, folder: Path, *view: str) -> tuple[str, list[str]]:
    """(the page as it stands after its scripts ran, lines of the browser's console); folder is for the browser's profile."""
    command = [str(BROWSER), *FLAGS.split(), *view, f"--user-data-dir={folder / 'profile'}", page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    return done.stdout, [line for line in done.stderr.splitlines() if "CONSOLE" in line]


def asked(page: Path, axe: str, view: tuple[str, ...], folder: Path) -> tuple[dict[str, object], list[str]]:
    """(what axe-core found on a page, lines of the browser's console)."""
    text = page.read_text(encoding="utf-8")
    end = text.rindex("</body>")
    copy = folder / "asked.html"
    inert = axe.replace("</script", "<\\/script")
    copy.write_text(f"{text[:end]}<script>{inert}</script>{ASKED}{text[end:]}", encoding="utf-8")
    shown, console = in_browser(copy, folder, *view)
    told = re.search(r'<pre id="found">(.*?)</pre>', shown, re.DOTALL)
    assert told, "axe-core came to no end"
    return json.loads(html.unescape(told[1])), console


def main() -> None:
    """Print the table."""
    if BROWSER is None:
        raise SystemExit("no chromium on this machine")
    axe = axe_core()
    print("| page | seen | rules passed | " + " | ".join(LEVELS) + " | console | fetched |")
    print("| --- | --- | ---: | " + "---: | " * len(LEVELS) + "---: | ---: |")
    for name, arguments in COMMANDS.items():
        with tempfile.TemporaryDirectory() as held:
            page = Path(held) / f"{name}.html"
            subprocess.run([sys.executable, "-m", "thermofast", *arguments, "-o", str(page), "-q"], check=True, cwd=ROOT)
            for view, flags in VIEWS:
                found, console = asked(page, axe, flags, Path(held))
                assert found["dark"] == view.startswith("dark")
                violations = found["violations"]
                assert isinstance(violations, list)
                counts = [sum(len(v["at"]) for v in violations if v["level"] == level) for level in LEVELS]
                said = " | ".join(str(n) for n in counts)
                print(f"| {name} | {view} | {found['passed']} | {said} | {len(console)} | {found['fetched']} |", flush=True)
                for one in violations:
                    print(f"{one['level']}: {one['rule']}: {one['at'][0][:120]}", file=sys.stderr)


if __name__ == "__main__":
    main()
