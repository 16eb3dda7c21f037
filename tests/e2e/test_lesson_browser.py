"""A lesson on a phone, and files and tables that are not what the page expects.

A tool that a phone does not show, an empty film, or a file without a sentence on its use would show here.
"""

DROP = (
    "const [name, content] = arguments, data = new DataTransfer(); data.items.add(new File([content], name));"
    "document.getElementById('status').textContent = '';"
    "document.dispatchEvent(new DragEvent('drop', {dataTransfer: data, bubbles: true, cancelable: true}))"
)
LENGTHS = {"crank": "20", "coupler": "60", "rocker": "55", "ground": "58"}


def test_a_lesson_on_a_phone(page) -> None:
    """A slider-crank of the gallery, own lengths, a film, arrows and centres, and a project with a name."""
    page.resize(360, 740)
    page.click("open-gallery")
    page.press("#lessons button")
    page.wait_for_results()
    assert page.text("status") == "Best found: met to within rounding." and page.count("#canvas .block[d]")
    page.press("#more")
    page.press("#entry-open")
    for name, length in LENGTHS.items():
        page.type_into(f"entry-{name}", length)
    page.press("#entry-form [type=submit]")
    page.wait_for_results()
    page.press("#show-menu")
    page.press("#arrows")
    page.press("#centres")
    assert page.shown("speed") and page.shown("play") and page.width <= 360
    page.slide(40)
    assert page.count(".lesson .arrow.tip") == 3 and page.count(".lesson .centre") == 2
    assert page.faults(".board") == []
    page.press("#record")
    page.wait("document.getElementById('record').textContent === 'Stop and save'")
    page.slide(60)
    page.wait("Number(document.getElementById('slider').value) > 60 || !document.getElementById('record').click()")
    assert page.saved("linkage.webm").startswith(b"\x1a\x45\xdf\xa3"), "the header of WebM"
    page.press("#more")
    page.type_into("project-name", "lesson")
    page.press("#project-form [type=submit]")
    assert "lesson is saved" in page.text("status")


def test_each_file_that_is_dropped_says_what_can_be_done_with_it(page) -> None:
    """On the first screen, where the status is covered, a message takes its place."""
    page.forget()
    page.go()
    for name, content, said in (
        ("a.xlsx", "PK", "copy its rows"),
        ("b.stl", "solid", "SVG or DXF"),
        ("c.pdf", "%PDF", "tables (CSV, TSV, text)"),
        ("d.bin", "\0\1", "contains no text"),
        ("e.svg", '<svg xmlns="http://www.w3.org/2000/svg"><path d="M0 0L9 0L9 5Z"/></svg>', "outline of the body"),
    ):
        page.run(DROP, name, content)
        page.wait("document.getElementById('status').textContent")
        assert said in page.text("status" if name == "e.svg" else "welcome-note"), name
    page.run(DROP, "path.csv", "x;y\n0;0\n10,5;2\n20;8,25\n8;15\n0;0\n")
    page.wait("document.getElementById('example-note').textContent.includes('path.csv')")
    assert "repeated the first" in page.text("example-note") and page.ticked("closed") and len(page.table()) == 4
    page.run(DROP, "poses.csv", "x;y;phi\n0;0;0\n10,5;2;0,21\n20;8,25;0,53\n8;15;1,1\n")
    page.wait("document.getElementById('example-note').textContent.includes('poses.csv')")
    assert "look like radians" in page.text("unwrap")
    page.press("#unwrap-use")
    assert [round(row[3]) for row in page.table()] == [0, 12, 30, 63] and not page.shown("unwrap")
    page.run(DROP, "long.csv", "x,y\n" + "\n".join(f"{k},{k * k / 900}" for k in range(2001)))
    page.wait("document.getElementById('example-note').textContent.includes('long.csv')")
    assert "One row in 3 is used" in page.text("example-note") and len(page.table()) == 667
    page.run(DROP, "law.csv", "input;output\n0;0\n20;11\n45;33\n")
    page.wait("document.body.dataset.kind === 'function'")
