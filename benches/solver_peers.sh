#!/bin/sh
# Runs the solver and its peers on all problems of a folder that benches/setup_peers.sh has made; the tables go to standard output.
#   benches/solver_peers.sh FOLDER [ROUNDS]
# Results are left in FOLDER as boards.json, bal-*.json and graphs.json.
set -e
[ -n "$1" ] || { sed -n 2,5p "$0"; exit 2; }
here=$(cd "$(dirname "$0")" && pwd)
folder=$(cd "$1" && pwd)
rounds=${2:-5}
python=$folder/venv/bin/python
"$python" "$here/compare.py" --peers "$folder" --bal none --rounds "$rounds" --json "$folder/boards.json"
for problem in "$folder"/data/problem-*.txt "$folder"/data/street-*.txt; do
    [ -e "$problem" ] || continue
    name=$(basename "$problem" .txt)
    echo
    echo "## $name"
    "$python" "$here/compare.py" --peers "$folder" --sizes "" --bal "$problem" --rounds "$rounds" --json "$folder/bal-$name.json"
done
echo
"$python" "$here/pose_graph_peers.py" --graphs "$folder/graphs" --gtsam-python "$python" --rounds "$rounds" --json "$folder/graphs.json"
