# bash completion for tsuya.  Commands and options are asked of the program, so that nothing here grows old.
_tsuya_commands() {
    "$1" --help 2>/dev/null | awk '/^Commands:/ { inside = 1; next } /^$/ { inside = 0 } inside { sub(/^  /, ""); sub(/   *.*/, ""); print }'
}
_tsuya() {
    local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD-1]} program=${COMP_WORDS[0]}
    local all=$(_tsuya_commands "$program") second
    COMPREPLY=()
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W "$(echo "$all" | awk '{ print $1 }' | sort -u) --help --version" -- "$cur"))
        return
    fi
    case "$prev" in
    --from|--to) COMPREPLY=($(compgen -W "capture calib reconstruct weave brdf render report" -- "$cur")); return ;;
    esac
    second=$(echo "$all" | awk -v first="${COMP_WORDS[1]}" '$1 == first && NF == 2 { print $2 }')
    if [ "$COMP_CWORD" -eq 2 ] && [ -n "$second" ]; then
        COMPREPLY=($(compgen -W "$second" -- "$cur"))
        return
    fi
    if [[ $cur == -* ]]; then
        local command=("$program" "${COMP_WORDS[1]}")
        [ -n "$second" ] && command+=("${COMP_WORDS[2]}")
        COMPREPLY=($(compgen -W "$("${command[@]}" --help 2>/dev/null | grep -o -- '--[a-z][a-z-]*' | sort -u)" -- "$cur"))
        return
    fi
    COMPREPLY=($(compgen -f -- "$cur"))
    compopt -o filenames 2>/dev/null
}
complete -F _tsuya tsuya
