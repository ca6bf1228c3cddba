"""Keys typed ahead of a slow window."""

from flyaround.gui.key_queue import REST_FRAMES, KeyQueue
from flyaround.gui.surface import import_parts

CTRL, PRESS, RELEASE, REPEAT, ESCAPE, ENTER, DELETE = 2, 1, 0, 2, 256, 257, 261


def queue_of(taken, *, typing=False):
    """A queue that notes keys with what was done to them, and letters."""
    return KeyQueue(
        import_parts()[1],
        lambda _, key, __, action, ___: taken.append((key, action)),
        lambda _, c: taken.append(chr(c)),
        urgent=lambda key: key == DELETE,
        typing=lambda: typing,
    )


def test_letters_wait_until_what_a_key_with_ctrl_opened_is_drawn():
    taken = []
    queue = queue_of(taken)
    events = ((ESCAPE, PRESS, 0), (80, PRESS, CTRL), (80, RELEASE, CTRL), (71, PRESS, 0))
    for key, action, modifiers in events:
        queue.key(None, key, 0, action, modifiers)
    queue.letter(None, ord("g"))
    seen = []
    for _ in range(2 * (REST_FRAMES + 1) + 1):
        queue.deliver()
        seen.append(len(taken))
    assert taken == [(ESCAPE, PRESS), (80, PRESS), (80, RELEASE), (71, PRESS), "g"]
    assert seen == [1] * (REST_FRAMES + 1) + [2] * (REST_FRAMES + 1) + [5]
    assert not queue


def test_keys_without_ctrl_come_at_once_and_in_order():
    taken = []
    queue = queue_of(taken)
    for key in (87, 65, 83, 68):
        queue.key(None, key, 0, PRESS, 1)
    queue.deliver()
    assert taken == [(key, PRESS) for key in (87, 65, 83, 68)]


def test_what_would_wait_in_dear_imgui_waits_here():
    """Of "aa" and Enter: a letter a frame, and Enter by itself."""
    taken = []
    queue = queue_of(taken)
    for _ in range(2):
        queue.key(None, 65, 0, PRESS, 0)
        queue.letter(None, ord("a"))
        queue.key(None, 65, 0, RELEASE, 0)
    queue.key(None, ENTER, 0, PRESS, 0)
    frames = []
    while queue:
        before = len(taken)
        queue.deliver()
        frames.append(taken[before:])
    assert frames == [
        [(65, PRESS), "a"],
        [(65, RELEASE)],
        [(65, PRESS), "a"],
        [(65, RELEASE), (ENTER, PRESS)],
    ]


def test_repeats_of_a_held_key_do_not_wait():
    taken = []
    queue = queue_of(taken)
    queue.key(None, 87, 0, PRESS, 0)
    for _ in range(100):
        queue.key(None, 87, 0, REPEAT, 0)
    queue.key(None, 87, 0, RELEASE, 0)
    assert len(queue) == 2


def test_an_urgent_key_overtakes_and_discards_the_presses_before_it():
    taken = []
    queue = queue_of(taken)
    queue.key(None, 65, 0, PRESS, 0)
    queue.deliver()
    queue.key(None, 65, 0, RELEASE, 0)
    for _ in range(5):
        queue.key(None, 87, 0, PRESS, 0)
        queue.key(None, 87, 0, RELEASE, 0)
    queue.key(None, DELETE, 0, PRESS, 0)
    queue.deliver()
    assert taken[1] == (DELETE, PRESS)
    assert (65, RELEASE) in taken
    while queue:
        queue.deliver()
    assert (87, PRESS) not in taken


def test_an_urgent_key_waits_for_what_ends_a_line_of_text():
    taken = []
    queue = queue_of(taken)
    queue.key(None, ESCAPE, 0, PRESS, 0)
    queue.key(None, DELETE, 0, PRESS, 0)
    queue.deliver()
    assert taken == [(ESCAPE, PRESS)]
    while queue:
        queue.deliver()
    assert taken[-1] == (DELETE, PRESS)


def test_a_line_of_text_needs_one_frame_and_no_key_of_it_is_taken():
    taken = []
    queue = queue_of(taken, typing=True)
    for c in "tcp://nowhere":
        queue.key(None, ord(c.upper()), 0, PRESS, 0)
        queue.letter(None, ord(c))
        queue.key(None, ord(c.upper()), 0, RELEASE, 0)
    queue.key(None, ENTER, 0, PRESS, 0)
    queue.deliver()
    assert "".join(e for e in taken if isinstance(e, str)) == "tcp://nowhere"
    assert not [e for e in taken if isinstance(e, tuple) and e[1] == PRESS]
    queue.deliver()
    assert taken[-1] == (ENTER, PRESS)


def test_a_key_held_since_before_the_field_is_released():
    taken = []
    queue = queue_of(taken, typing=True)
    queue.key(None, 87, 0, RELEASE, 0)
    queue.deliver()
    assert taken == [(87, RELEASE)]


def test_letters_wait_until_the_field_that_a_click_opened_is_drawn():
    taken = []
    queue = queue_of(taken)
    for name in ("down", "up"):
        queue.click(lambda name=name: taken.append(name))
    queue.key(None, 71, 0, PRESS, 0)
    queue.letter(None, ord("g"))
    seen = []
    while queue:
        queue.deliver()
        seen.append(len(taken))
    assert taken == ["down", "up", (71, PRESS), "g"]
    assert seen == [1] + [2] * (REST_FRAMES + 1) + [4]


def test_letters_before_a_click_are_taken_before_it():
    taken = []
    queue = queue_of(taken, typing=True)
    for c in "ab":
        queue.key(None, ord(c.upper()), 0, PRESS, 0)
        queue.letter(None, ord(c))
        queue.key(None, ord(c.upper()), 0, RELEASE, 0)
    queue.click(lambda: taken.append("down"))
    queue.deliver()
    assert "down" not in taken
    queue.deliver()
    assert [e for e in taken if isinstance(e, str)] == ["a", "b", "down"]


def test_a_letter_waits_for_shift_as_in_dear_imgui():
    """It would wait there, and Enter behind it, beyond the pause that Enter has here."""
    taken, shift = [], 340
    queue = queue_of(taken, typing=True)
    queue.letter(None, ord("n"))
    queue.key(None, shift, 0, PRESS, 0)
    queue.letter(None, ord("_"))
    queue.key(None, shift, 0, RELEASE, 1)
    queue.letter(None, ord("s"))
    queue.key(None, ENTER, 0, PRESS, 0)
    frames = []
    while queue:
        before = len(taken)
        queue.deliver()
        frames.append(taken[before:])
    assert frames == [["n", (shift, PRESS)], ["_", (shift, RELEASE)], ["s"], [(ENTER, PRESS)]]
