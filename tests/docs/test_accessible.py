"""Written pages are repaired for screen readers and keys, once."""

import accessible
import pytest

HIDDEN = '<span class="visually-hidden">h</span>'


@pytest.mark.parametrize(
    ("found", "wanted"),
    [
        ("<pre>code</pre>", '<pre tabindex="0">code</pre>'),
        ("<dl>\n<dd><em>a</em>,</dd>\n<dd>b</dd>\n</dl>",
         '<div class="sig-lines"><div><em>a</em>,</div>\n<div>b</div>\n</div>'),
        ("<dl>\n<dt>term</dt><dd>text</dd>\n</dl>", "<dl>\n<dt>term</dt><dd>text</dd>\n</dl>"),
        ('<th class="head"><p><math><mi>h</mi></math></p></th>',
         '<th class="head"><p><math aria-hidden="true"><mi>h</mi></math>' + HIDDEN + "</p></th>"),
    ],
)  # fmt: skip
def test_a_page_is_repaired_once(found, wanted):
    assert accessible.repaired(found) == wanted
    assert accessible.repaired(wanted) == wanted
