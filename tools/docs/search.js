// SPDX-License-Identifier: MIT
// Finds pages in `stored`, mkdocs' index, without a server: mkdocs' own script fetches it, which no browser does for a file.
const results = document.getElementById("mkdocs-search-results");
if (results) {
  const index = lunr(function () {
    this.ref("place");
    this.field("title", { boost: 10 });
    this.field("text");
    stored.docs.forEach((part, place) => this.add({ ...part, place }));
  });
  const query = document.getElementById("mkdocs-search-query");
  const add = (parent, name, text) => Object.assign(parent.appendChild(document.createElement(name)), { textContent: text });
  const show = () => {
    results.replaceChildren();
    const words = query.value.replace(/[^\p{L}\p{N}_]+/gu, " ").trim();  // lunr takes + - : ^ ~ * for orders; `word` is stemmed, `word*` begins one
    const found = words ? index.search(words.split(" ").map((word) => `${word}^2 ${word}*`).join(" ")) : [];
    if (found.length === 0) add(results, "p", words ? "No results found" : "");
    for (const { ref } of found.slice(0, 30)) {
      const { location, title, text } = stored.docs[ref], article = results.appendChild(document.createElement("article"));
      add(add(article, "h3", ""), "a", title).href = location;
      add(article, "p", text.slice(0, 200));
    }
  };
  query.value = new URLSearchParams(window.location.search).get("q") ?? "";
  query.addEventListener("input", show);
  show();
}
