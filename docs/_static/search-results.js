/* Results of the search: words are found from their beginning, and excerpts have no formulas in TeX. */
{
  const objects = Search.performObjectSearch;
  Search.performObjectSearch = (object, terms) =>
    objects(object, terms).filter(([, name, , description]) =>
      [...terms].every((term) => new RegExp(`(?<![\\p{L}\\p{N}])${term}`, "iu").test(`${name} ${description}`)));

  const parse = Search._parseQuery;
  let words = [];
  Search._parseQuery = (query) => {
    const parsed = parse(query);
    words = [...parsed[3]].sort((a, b) => b.length - a.length);
    // Sphinx would mark the letters of words within others.
    parsed[3] = new Set();
    localStorage.removeItem("sphinx_highlight_terms");
    return parsed;
  };

  const pattern = (terms, flags) => {
    const escaped = terms.map((term) => term.replace(/[.*+?^${}()|[\]\\]/g, "\\$&") + (term.length < 3 ? "(?![\\p{L}\\p{N}])" : ""));
    return new RegExp(`(?<![\\p{L}\\p{N}])(?:${escaped.join("|") || "$^"})`, flags);
  };
  Search.makeSearchSummary = (html, keywords, anchor) => {
    const text = Search.htmlToText(html.replace(/\\\([^]*?\\\)|\\\[[^]*?\\\]/g, "…"), anchor).replace(/\s+/g, " ");
    const terms = [...words, ...keywords], before = 60;
    // Whole words about the first place behind the heading.
    const index = pattern(terms, "iu").exec(text.slice(before))?.index ?? 0;
    const first = index && text.indexOf(" ", index) + 1;
    const shown = (first ? "… " : "") + text.slice(first, text.lastIndexOf(" ", first + 180)) + " …";
    const summary = document.createElement("p");
    summary.className = "context";
    let last = 0;
    for (const { 0: word, index } of shown.matchAll(pattern(terms, "giu"))) {
      const mark = document.createElement("span");
      mark.className = "highlighted";
      mark.textContent = word;
      summary.append(shown.slice(last, index), mark);
      last = index + word.length;
    }
    summary.append(shown.slice(last));
    return summary;
  };
}
