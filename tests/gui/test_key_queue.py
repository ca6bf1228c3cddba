"""Keys typed ahead of a slow window."""

from gui.key_queue import REST_FRAMES, KeyQueue

CTRL, PRESS, RELEASE, ESCAPE, ENTER = 2, 1, 0, 256, 257


def test_letters_wait_until_what_a_key_with_ctrl_opened_is_drawn():
    taken = []
    queue = KeyQueue(
        lambda _, key, *__: taken.append(key),
        lambda _, c: taken.append(chr(c)),
        pressed=PRESS,
        ctrl=CTRL,
        turns=(ESCAPE,),
    )
    events = ((ESCAPE, PRESS, 0), (80, PRESS, CTRL), (80, RELEASE, CTRL), (71, PRESS, 0))
    for key, action, modifiers in events:
        queue.key(None, key, 0, action, modifiers)
    queue.letter(None, ord("g"))
    seen = []
    for _ in range(2 * (REST_FRAMES + 1) + 1):
        queue.deliver()
        seen.append(len(taken))
    assert taken == [ESCAPE, 80, 80, 71, "g"]
    assert seen == [1] * (REST_FRAMES + 1) + [2] * (REST_FRAMES + 1) + [5]
    assert not queue


def test_keys_without_ctrl_come_at_once_and_in_order():
    taken = []
    queue = KeyQueue(
        lambda _, key, *__: taken.append(key), lambda *_: None, pressed=PRESS, ctrl=CTRL, turns=(ESCAPE,)
    )
    for key in (87, 65, 83, 68):
        queue.key(None, key, 0, PRESS, 1)
    queue.deliver()
    assert taken == [87, 65, 83, 68]


def test_what_would_wait_in_dear_imgui_waits_here():
    """Of "aa" and Enter: a letter a frame, and Enter by itself."""
    taken = []
    queue = KeyQueue(
        lambda _, key, __, action, ___: taken.append((key, action)),
        lambda _, c: taken.append(chr(c)),
        pressed=PRESS,
        ctrl=CTRL,
        turns=(ENTER,),
    )
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
