/* page_files: what is in tools/page, and three.js, as bytes; made by CMake (cmake/embed.cmake). */
#ifndef WH_TOOLS_PAGE_FILES_H
#define WH_TOOLS_PAGE_FILES_H

#include <stddef.h>

/* Each with a zero behind it, so that text may be taken for a string. */
extern const unsigned char page_frame[], page_report[], page_css[], page_view[], page_three[],
    page_licence[];
extern const unsigned char page_levels[], page_play[], page_play_html[];
extern const size_t page_frame_bytes, page_report_bytes, page_css_bytes, page_view_bytes,
    page_licence_bytes;
extern const size_t page_three_bytes; /* 0: built without three.js */

#endif
