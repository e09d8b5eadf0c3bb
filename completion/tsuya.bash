# bash completion for tsuya
_tsuya() {
    local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD-1]}
    local stages="capture calib reconstruct weave brdf render report"
    local common="--threads --seed --json --quiet --help --version"
    COMPREPLY=()
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W "demo run capture reconstruct weave brdf render --help --version" -- "$cur"))
        return
    fi
    case "$prev" in
    --from|--to) COMPREPLY=($(compgen -W "$stages" -- "$cur")); return ;;
    --threads|--seed|--turntable|--spp|--bounces|--noise|--color|--size) return ;;
    esac
    if [ "$COMP_CWORD" -eq 2 ]; then
        case "${COMP_WORDS[1]}" in
        capture) COMPREPLY=($(compgen -W "check" -- "$cur")); return ;;
        weave) COMPREPLY=($(compgen -W "image mesh" -- "$cur")); return ;;
        brdf) COMPREPLY=($(compgen -W "eval" -- "$cur")); return ;;
        esac
    fi
    if [[ $cur == -* ]]; then
        # The program knows its own options.
        local command=("${COMP_WORDS[0]}" "${COMP_WORDS[1]}")
        case "${COMP_WORDS[1]}" in capture|weave|brdf) command+=("${COMP_WORDS[2]}") ;; esac
        COMPREPLY=($(compgen -W "$("${command[@]}" --help 2>/dev/null | grep -o -- '--[a-z-]*' | sort -u) $common" -- "$cur"))
        return
    fi
    COMPREPLY=($(compgen -f -- "$cur"))
    compopt -o filenames 2>/dev/null
}
complete -F _tsuya tsuya
