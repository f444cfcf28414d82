#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# docs.sh: build/docs, the documentation as a site that needs no network. Broken links and warnings of Doxygen are errors.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly PAGES=build/docs_pages
tools/setup.sh docs
rm -rf "$PAGES" build/docs
mkdir -p "$PAGES"
cp -r docs/*.md docs/images docs/lab tools/docs/api.md "$PAGES"
cp tools/docs/wide.css "$PAGES"
mv "$PAGES/search.md" "$PAGES/filter_search.md" # search.html is mkdocs' own
cp README.md "$PAGES/index.md"
cp CHANGELOG.md "$PAGES/changelog.md"
cp CONTRIBUTING.md "$PAGES/contributing.md"
cp examples/README.md "$PAGES/examples.md"
# Links as they are in the repository, to pages of the site; files that are no pages are named only.
sed -i -E -e 's#(\]\(|<img src=")(\.\./)?docs/#\1#g' -e 's#\]\(((docs/|\.\./)*)search\.md#](\1filter_search.md#g' -e 's#\]\((\.\./)?CHANGELOG\.md#](changelog.md#g' -e 's#\]\((\.\./)?CONTRIBUTING\.md#](contributing.md#g' \
  -e 's#\]\((\.\./)?examples/README\.md#](examples.md#g' -e 's#\]\((\.\./)?README\.md#](index.md#g' \
  -e 's#\[([^]]*)\]\((\.\./)*(config|examples|bench|tests|tools|src|include|models|ci)/[^)]*\)#\1#g' \
  -e 's#\[([^]]*)\]\([a-z_]+\.(cpp|py|txt)\)#\1#g' "$PAGES"/*.md "$PAGES"/lab/*.md

# Doxygen first: a page links to it. (mkdocs --quiet would not count warnings.)
doxygen tools/docs/Doxyfile
build/venv-docs/bin/mkdocs build --config-file tools/docs/mkdocs.yml
grep -q mkdocs-search-results build/docs/search.html || { echo "docs: a page of ours has the name of the site's search" >&2; exit 1; }
{ cat build/docs/search/lunr.js && printf ';const stored = ' && cat build/docs/search/search_index.json && printf ';\n' && cat tools/docs/search.js; } >build/docs/search/main.js
if grep -rlE '<(script|link|img)[^>]+(src|href)="(https?:)?//' build/docs --include='*.html'; then
  echo "docs: the pages above fetch something from the network" >&2
  exit 1
fi
# mkdocs looks at Markdown's links only.
while IFS=: read -r page image; do
  [[ -s $(dirname "$page")/$image ]] || { echo "docs: $page: expected the image $image, found none" >&2; exit 1; }
done < <(grep -roP '<img [^>]*src="\K(?!data:)[^"]+' build/docs --include='*.html' | sort -u)
echo "docs: build/docs/index.html"
