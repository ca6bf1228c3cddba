#!/bin/sh
# The unit that board.pyz prints, held against docs/hil_board.md on a board with systemd; run by service_checks.py as root
# with `target` (a bundled model) and `url` (of a host that comes when one is asked for). Port 9 of the host is nobody's.
set -u
name=flyaround-board
unit=/etc/systemd/system/$name.service
program=/opt/flyaround/board.pyz
nobody=tcp://10.0.2.2:9

check() {
  what=$1; shift
  if "$@"; then echo "holds: $what"; else echo "FAILS: $what"; fi
}
show() { systemctl show --value --property="$1" $name; }
is() { [ "$(show "$1")" = "$2" ] || { echo "  $1 is $(show "$1"), not $2"; return 1; }; }
within() { # seconds, condition
  seconds=$1; shift
  for _ in $(seq "$seconds"); do "$@" > /dev/null && return; sleep 1; done
  "$@"
}
another() { pid=$(show MainPID); [ "$pid" != "$1" ] && [ "$pid" != 0 ]; }
said() { journalctl --output=cat --unit=$name | grep -q "$1"; }
install_unit() {
  python3 $program "$@" --systemd-unit > $unit && systemctl daemon-reload && systemctl reset-failed
}
ends() { # code, command
  code=$1; shift
  "$@" > /run/job/said 2>&1; got=$?
  [ $got = "$code" ] || { echo "  ended with $got"; tail -n 3 /run/job/said; return 1; }
}

useradd --system --no-create-home --shell /usr/sbin/nologin flyaround
mkdir -p /opt/flyaround && cp board.pyz /opt/flyaround/

install_unit $nobody --model "$target" --timeout 5
check "systemd finds no fault with the unit" ends 0 systemd-analyze verify $unit
systemd-analyze security --no-pager $name | tail -n 1
check "it starts, and tells when it is ready" systemctl enable --now $name
check "it is active" is ActiveState active
check "it runs as its own user" [ "$(stat -c %U "/proc/$(show MainPID)")" = flyaround ]
check "nothing is unpacked" [ -z "$(find /tmp/systemd-private-*$name*/tmp -mindepth 1)" ]
check "it says why no host is met" within 60 said 'trying again'

pid=$(show MainPID)
kill -KILL "$pid"
check "killed, it is back" within 30 another "$pid"
check "after one restart" is NRestarts 1
within 300 is ActiveState active

pid=$(show MainPID)
kill -STOP "$pid"
check "stopped in its tracks, the watchdog ends it" within 120 said 'Watchdog timeout'
check "and it is back" within 120 another "$pid"
within 300 is ActiveState active

check "a stop is orderly" systemctl stop $name
check "by SIGTERM: code 143" is ExecMainStatus 143
check "which counts as success" is Result success

install_unit $nobody --model nothing
check "a mistake in the command line fails at once" ends 1 systemctl start $name
sleep 3
check "with code 2" is ExecMainStatus 2
check "and is not tried again" is NRestarts 0

check "nobody listens: code 4" ends 4 python3 $program $nobody --model "$target" --timeout 1
check "SIGTERM: code 143" ends 143 \
  timeout --signal=TERM --preserve-status 60 python3 $program $nobody --model "$target" --timeout 300
check "Ctrl-C: code 130" ends 130 \
  timeout --signal=INT --preserve-status 60 python3 $program $nobody --model "$target" --timeout 300

install_unit "$url" --model "$target" --watchdog 1
check "it starts with a shorter watchdog" systemctl start $name
pid=$(show MainPID)
restarts=$(show NRestarts)
echo "a host is wanted"
check "an estimator that takes longer is given up" within 300 said 'the watchdog stopped the estimator'
check "and the agent starts anew" within 60 said 'the agent starts anew'
sleep 10
check "in the same process" is MainPID "$pid"
check "which systemd did not start" is NRestarts "$restarts"
check "and which is active" is ActiveState active

journalctl --no-pager --output=cat --unit=$name | tail -n 60
echo "all of the service is checked"
