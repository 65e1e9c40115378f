# shellcheck shell=bash
# Completion for bash: the options of shear-warp-mip and the names that they take, from what --help-all says; else files.
_shear_warp_mip() {
  local word=${COMP_WORDS[COMP_CWORD]} option=${COMP_WORDS[COMP_CWORD - 1]} help words=
  help=$'\n'$("$1" --help-all 2> /dev/null)
  if [ "$word" = = ]; then
    word=
  elif [ "$option" = = ]; then
    option=${COMP_WORDS[COMP_CWORD - 2]}
  fi
  if [[ $word == -* ]]; then
    words=$(grep -E '^  (OUTPUT|-)' <<< "$help" | grep -oE '^ +([A-Z]+, )?(--?[a-z0-9-]+(, )?)+' | tr -s ', ' '\n')
  elif [[ $help =~ $'\n'\ +"$option "[^[:space:]]*\{([^\}]*)\} ]]; then
    words=${BASH_REMATCH[1]//,/ }
  fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word")
}
complete -o default -F _shear_warp_mip shear-warp-mip
