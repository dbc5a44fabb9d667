import io

from report_cases import HOSTILE, comparison
from rich.console import Console

from skred.report.shared.tables import comparison_table, summary_table


def shown(table, width=80):
    file = io.StringIO()
    Console(file=file, width=width).print(table)
    return file.getvalue()


def test_comparison_fits_a_narrow_terminal():
    text = shown(comparison_table(comparison()))
    assert "…" not in text
    row = next(line for line in text.splitlines() if line.startswith("constant"))
    assert row.split()[1:3] == ["-64.60", "-4.90"]
    assert "coulomb" in text and "not converged" in text
    assert "coulomb did not converge: r-hat 1.312 exceeds 1.01: more --tune" in " ".join(text.split())


def test_summary_has_units_interval_and_diagnostics():
    text = shown(summary_table(comparison()["models"][0]))
    assert "90 % interval" in text and "equal-tailed" in text
    assert "0.243 to 0.333" in text and "1.002" in text and "mu (a0)" in text
    assert "Converged." in text
    assert "more --tune" in shown(summary_table(comparison()["models"][2]))


def test_names_are_not_markup():
    document = comparison()
    for model in document["models"]:
        model.update(id=HOSTILE, title=HOSTILE)
        model["parameters"][0].update(name=HOSTILE, symbol=HOSTILE, unit=HOSTILE)
        model["gate"]["problems"] = [HOSTILE]
    document["campaign"]["name"] = HOSTILE
    for text in (shown(comparison_table(document), 200), shown(summary_table(document["models"][2]), 200)):
        assert "[red]" in text.replace("\n", "")
        assert "\x1b" not in text


def test_nulls():
    assert "n/a" in shown(summary_table({"parameters": [{"name": "a"}]}))
    assert "laws compared" in shown(comparison_table({"models": [{"gate": {"passed": True}, "id": "a"}, {}]}))
