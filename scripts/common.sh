# Sourced by the other scripts: folders, a PATH that the system's Python comes first on, and a way to
# run noisy commands.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=$root/build
logs=$build/logs
mkdir -p "$logs"

# catkin and the messages need Debian's own Python, not one of pyenv or conda.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin:$PATH
unset PYTHONHOME PYTHONPATH VIRTUAL_ENV CONDA_PREFIX PYENV_VERSION || true
export PYTHONDONTWRITEBYTECODE=1

say() { printf '%s\n' "$*"; }

die() {
  printf '%s\n' "$*" >&2
  exit 1
}

# logged NAME COMMAND...: the noise goes to a log file. A dot every few seconds shows life; lines of
# the form [done/all] or NN% are shown as they come. On failure: the last lines and the file's name.
logged() {
  local name=$1 log status=0
  shift
  log=$logs/${name// /_}.log
  printf '%s ' "$name"
  "$@" >"$log" 2>&1 &
  local pid=$! begin=$SECONDS shown='' progress
  while kill -0 "$pid" 2>/dev/null; do
    sleep 0.5
    progress=$(tail -c 4000 "$log" | grep -aoE '^\[[0-9]+/[0-9]+\]|^ *[0-9]+/[0-9]+ Test' | tail -1 || true)
    if [ -t 1 ]; then
      printf '\r%s %s %ds ' "$name" "$progress" $((SECONDS - begin))
    elif [ $((SECONDS - begin)) -ge $((${shown:-0} + 15)) ]; then
      shown=$((SECONDS - begin))
      printf '%s %ds ... ' "$progress" "$shown"
    fi
  done
  wait "$pid" || status=$?
  if [ "$status" -ne 0 ]; then
    printf '\n%s FAILED. The last lines of %s:\n' "$name" "$log"
    tail -n 40 "$log"
    say "(all of it: $log)"
    return "$status"
  fi
  [ -t 1 ] && printf '\r\033[K%s ' "$name"
  say "done in $((SECONDS - begin)) s"
}
