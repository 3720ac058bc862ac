from lockstep.bench.figures.results import Result
from lockstep.bench.figures.table import render_markdown, render_table


def figure(value: float | None, **fields: object) -> Result:
    return Result(**({"section": "lossy", "name": "p99", "value": value, "unit": "ms"} | fields))  # type: ignore[arg-type]


def test_a_target_is_met_on_its_good_side_and_at_the_bound() -> None:
    assert figure(8.0, target=8.0).met is True
    assert figure(8.1, target=8.0).met is False
    assert figure(100.0, target=100.0, bound="at least").met is True
    assert figure(99.0, target=100.0, bound="at least").met is False


def test_what_could_not_be_measured_misses_its_target() -> None:
    assert figure(None, target=8.0).met is False
    assert figure(None).met is None


def test_the_ratio_is_ours_to_the_baselines() -> None:
    assert figure(50.0, baseline=200.0).ratio == 0.25
    assert figure(50.0).ratio is None
    assert figure(50.0, baseline=0.0).ratio is None


def test_json_fields_carry_the_verdict_and_the_command() -> None:
    fields = figure(50.0, baseline=200.0, target=40.0).fields()
    assert fields["met"] is False
    assert fields["ratio"] == 0.25
    assert fields["command"] == "make bench ARGS=lossy"


def test_the_table_names_misses_units_and_ratios() -> None:
    table = render_table(
        [
            figure(7.123, name="median", target=8.0),
            figure(45.0, target=20.0, baseline=90.0, baseline_name="the link alone", conditions="on loopback"),
        ]
    )
    lines = table.splitlines()
    assert lines[2] == "lossy"
    assert lines[3].split() == ["median", "7.12", "ms", "≤", "8", "met"]
    assert lines[4].split() == ["p99", "45", "ms", "≤", "20", "MISSED", "90", "ms", "0.50"]
    assert lines[5:] == ["  · on loopback", "  · baseline: the link alone"]


def test_the_table_says_shared_conditions_once_for_each_section() -> None:
    table = render_table([figure(1.0, conditions="c"), figure(2.0, conditions="c"), figure(3.0, section="other")])
    assert table.count("· c") == 1
    assert table.count("\nother\n") == 1


def test_columns_line_up() -> None:
    table = render_table([figure(1.0, name="a", target=2.0), figure(1234.0, name="much longer", target=2.0)])
    short, long = table.splitlines()[3:5]
    assert short.index("≤") == long.index("≤")


def test_numbers_keep_three_digits_without_an_exponent() -> None:
    table = render_table([figure(value) for value in (0.0123, 0.456, 12.34, 12345.6, 3.0)])
    assert [line.split()[1] for line in table.splitlines()[3:]] == ["0.012", "0.46", "12.3", "12346", "3"]


def test_what_could_not_be_measured_is_said() -> None:
    assert "not measured" in render_table([figure(None, target=1.0)])


def test_markdown_has_a_table_for_each_section_and_marks_misses() -> None:
    markdown = render_markdown([figure(45.0, target=20.0, baseline=90.0), figure(1.0, section="other", target=2.0)])
    assert "### lossy\n\n`make bench ARGS=lossy`\n" in markdown
    assert "| p99 | 45 ms | ≤ 20 | **MISSED** | 90 ms | 0.50 |" in markdown
    assert "| p99 | 1 ms | ≤ 2 | met |  |  |" in markdown


def test_a_stacked_figure_is_drawn_part_on_part() -> None:
    parts = [figure(10.0, name="a", stacked_on=0.0), figure(0.0, name="b", stacked_on=10.0)]
    lines = render_table([*parts, figure(30.0, name="c", stacked_on=10.0), figure(5.0, name="sum")]).splitlines()
    bars = [line.partition(" ms")[2].rstrip() for line in lines[3:7]]
    assert [bar.count("█") for bar in bars] == [10, 0, 30, 0]
    assert bars[0].index("█") + 10 == bars[2].index("█") == bars[1].index("▏")
