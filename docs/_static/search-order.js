/* Pages that teach come before lists of names; names of the public interface before what is inside. */
var Scorer = {
  score: ([page, title, anchor, description, score]) => {
    const inside = /^(reference\/inside|_modules)\//.test(page);
    const lists = /^(reference\/modules|gallery|measured)\//.test(page);
    return score - (inside ? 40 : lists ? 12 : 0) + (/^(start|theory|how-to)\//.test(page) ? 3 : 0);
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
