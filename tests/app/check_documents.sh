#!/bin/sh
# check_documents.sh PROGRAM SOURCE_FOLDER
# Every command of the program is in README's table, in the man page and in both completions; what the documents name exists.
set -u

program=$1 source=$2
failed=0
complain() {
    echo "$*"
    failed=1
}

commands=$("$program" --help | awk '/^Commands:/ { inside = 1; next } /^$/ { inside = 0 } inside { print substr($0, 3, 24) }' |
    sed 's/   *.*//; s/ *$//' | tr ' ' '_')
[ -n "$commands" ] || complain "tsuya --help lists no commands"

for entry in $commands; do
    command=$(echo "$entry" | tr '_' ' ')
    grep -q "^|.*\`tsuya $command[ \`]" "$source/README.md" || complain "README.md: no row for 'tsuya $command'"
    # .B weave mesh / .BI run " JOB.yaml" / .BI "weave image" " PHOTO" / .BR demo " [" \fIDIR\fR ]
    grep -qE "^\.B[IR]? \"?$command\"?( |\$)" "$source/docs/tsuya.1" || complain "docs/tsuya.1: no entry for '$command'"
done

# Files that the documents link to.
(cd "$source" && for page in README.md docs/*.md; do
    for link in $(grep -o '](\([^)#:]*\)' "$page" | sed 's/^](//'); do
        [ -e "$(dirname "$page")/$link" ] || echo "$page: $link does not exist"
    done
done) | grep . && failed=1

# The completions ask the program: what they offer is what it has.
if command -v bash >/dev/null; then
    PATH="$(dirname "$program"):$PATH" bash -s "$source" $commands <<'BASH' || failed=1
source "$1/completion/tsuya.bash"
shift
code=0
listing=$(_tsuya_commands tsuya)
_tsuya_commands() { echo "$listing"; } # asked once
offers() { # WORD... EXPECTED
    local words=("${@:1:$#-1}")
    COMP_WORDS=("${words[@]}") COMP_CWORD=$((${#words[@]} - 1))
    _tsuya
    case " ${COMPREPLY[*]} " in
    *" ${*: -1} "*) ;;
    *) echo "bash completion: '${words[*]}' does not offer '${*: -1}' but: ${COMPREPLY[*]}"; code=1 ;;
    esac
}
for entry; do
    case $entry in
    *_*) offers tsuya "${entry%_*}" "" "${entry#*_}"; pair=$entry ;;
    *) offers tsuya "" "$entry" ;;
    esac
done
offers tsuya run --fr --from
offers tsuya "${pair%_*}" "${pair#*_}" --thr --threads
offers tsuya run --from r reconstruct
exit $code
BASH
fi
if command -v zsh >/dev/null; then
    zsh -n "$source/completion/_tsuya" || complain "completion/_tsuya: not valid zsh"
fi
if command -v groff >/dev/null; then
    said=$(groff -man -ww -z "$source/docs/tsuya.1" 2>&1)
    [ -z "$said" ] || complain "docs/tsuya.1: $said"
fi
exit $failed
