/* Pages that teach come before lists of names; names of the public interface before what is inside.
   What a page is about (extensions/topics.py) leads to the page, not to a place of it. A name that the
   query spells, "export C" for export_c, comes first. */
const spelled = (new URLSearchParams(location.search).get("q") ?? "").trim().toLowerCase().replace(/\s+/g, "_");
var Scorer = {
  score: (result) => {
    const [page, title, anchor, description, score, , kind] = result;
    if (kind === "index") result[2] = "";
    const inside = /^(reference\/inside|_modules)\//.test(page);
    const lists = /^(reference\/modules|gallery|measured)\//.test(page);
    const everything = /^(changelog|decisions|glossary|start\/tour|reference\/command-line)$/.test(page);
    const text = kind === "text", named = kind === "object" && title.toLowerCase().split(".").pop() === spelled;
    return score + (named ? 20 : 0) - (inside ? 40 : lists ? 12 : text && everything ? 8 : 0) + (/^(start|theory|how-to)\//.test(page) ? 3 : 0);
  },
  objNameMatch: 11,
  objPartialMatch: 4,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 9,
  term: 5,
  partialTerm: 2,
};
